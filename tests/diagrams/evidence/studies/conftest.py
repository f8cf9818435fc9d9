"""The problems of the solvers' own tests, for their peers, and made flights."""

import numpy as np
import pytest

from np_drake.training_data.segments import Segment
from tests.np_drake.mpc import conftest as problems

vehicle, config = problems.vehicle, problems.config
reaction, make_problem = problems.reaction, problems.make_problem
STEP = 0.0025  # of the synthetic flight [s]


def make_flight(samples, seed):
    """Return smooth force and torque driven by a smooth motion, with singular windows."""
    draw, t = np.random.default_rng(seed), STEP * np.arange(samples)[:, None, None]
    rate, phase = draw.uniform(2.0, 25.0, (12, 8)), draw.uniform(0, 2 * np.pi, (12, 8))
    waves = np.sin(rate * t + phase).sum(axis=2)
    return Segment(
        waves[:, :6] * np.repeat([1.0, 0.05], 3), waves[:, 6:] + 0.2 * waves[:, :6], STEP
    )


@pytest.fixture(scope="session")
def synthetic_flight():
    """`make_flight`."""
    return make_flight
