"""A vehicle, small configurations, and problems with a random stable lifted linear system."""

import numpy as np
import pytest

from np_drake import attitude
from np_drake.mpc.problem import MpcConfig, MpcProblem
from np_drake.residual_model import WrenchForecast
from np_drake.residual_models.motion_model import GaussianProcess
from np_drake.vehicle import Vehicle


@pytest.fixture(scope="session")
def vehicle() -> Vehicle:
    return Vehicle().check()


@pytest.fixture(scope="session")
def config() -> MpcConfig:
    return MpcConfig(horizon=10).check()


@pytest.fixture(scope="session")
def reaction() -> GaussianProcess:
    """A wrench that depends on the motion at once, strongly and nonlinearly."""
    rng = np.random.default_rng(5)
    weight = rng.normal(size=(12, 6)) * np.repeat([1.0, 0.02], 3)
    return GaussianProcess(rng.normal(size=(12, 6)), weight, np.full((6, 6), 1.5), 0.1 * weight[0])


@pytest.fixture(scope="session")
def make_problem(vehicle):
    """Hover at the origin; `offset` moves the start, by that in metres and half in m/s along x, y,
    z.
    """

    def make(config, *, K=24, offset=0.1, seed=0, tilt=0.0, reaction=None):
        rng, N = np.random.default_rng(seed), config.horizon
        A = rng.normal(size=(K, K))
        A *= 0.95 / np.abs(np.linalg.eigvals(A)).max() if K else 1.0
        C = 0.2 * rng.normal(size=(6, K)) * np.array([1, 1, 1, 0.02, 0.02, 0.02])[:, None]
        steady = 0.3 * rng.normal(size=6) * [1, 1, 1, 0.02, 0.02, 0.02]
        forecast = WrenchForecast(
            A,
            0.2 * rng.normal(size=(K, 6)),
            C,
            rng.normal(size=K),
            np.tile(steady, (N, 1)),
            reaction,
        )
        x_ref = np.zeros((N + 1, 13))
        x_ref[:, 3] = 1.0
        x0 = x_ref[0].copy()
        x0[:3], x0[7:10] = offset, 0.5 * offset
        x0[3:7] = attitude.quaternion_from_axes(np.array([np.sin(tilt), 0.0, np.cos(tilt)]), 0.0)
        return MpcProblem(x0, x_ref, np.tile(vehicle.hover_input, (N, 1)), forecast)

    return make
