"""Random motions of the paper's vehicle."""

import numpy as np
import pytest

from np_drake.effects.base import Measurement, Motion


def random_state(rng: np.random.Generator, n: int) -> np.ndarray:
    x = rng.normal(scale=3.0, size=(n, 13))
    x[:, 2] = rng.uniform(0.05, 3.0, n)
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
    return x


def random_motion(seed: int, n: int) -> Motion:
    rng = np.random.default_rng(seed)
    return Motion(
        t=np.sort(rng.uniform(0, 20, n)),
        x=random_state(rng, n),
        rotor_thrust=rng.uniform(0.5, 11.0, (n, 4)),
        wind=rng.normal(scale=2.0, size=(n, 3)),
        rotor_rate=rng.normal(scale=500.0, size=(n, 4)),
        nominal_thrust=rng.uniform(0.5, 11.0, (n, 4)),
    )


@pytest.fixture
def motion() -> Motion:
    return random_motion(0, 7)


@pytest.fixture
def reading() -> Measurement:
    rng = np.random.default_rng(1)
    x = random_state(rng, 7)
    return Measurement(
        x, rng.normal(size=(7, 3)), rng.normal(size=(7, 3)), rng.uniform(500, 900, (7, 4))
    )
