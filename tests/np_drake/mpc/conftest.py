"""A vehicle, small configurations, and problems with a random stable lifted linear system."""

import numpy as np
import pytest
from scipy.optimize import minimize

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


def lagging(u, acting, lag, step):
    """Return the mean over each step of what follows inputs u with a first-order lag."""
    found, time = [], np.linspace(0.0, step, 4001)
    for target in u:
        share = np.exp(-time / lag) if lag else np.zeros_like(time)
        found.append(target + 0.5 * (share[1:] + share[:-1]).mean() * (acting - target))
        acting = target + share[-1] * (acting - target)
    return np.array(found)


@pytest.fixture(scope="session")
def make_problem(vehicle):
    """Hover at the origin; the start is off by `offset` in metres and half in m/s."""

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


def _least_cost(condensed, problem, solution) -> float:
    """The least cost that a general optimiser finds around a solution, by single shooting."""
    c, by, f = condensed.config, condensed.actuation, problem.forecast
    h = condensed.prepare(problem)

    def cost(T: np.ndarray) -> float:
        x, z, course = h.x0, f.z, [h.x0]
        total = (x - h.x_ref[0]) ** 2 @ c.Q
        for i, u in enumerate(T.reshape(-1, 4) @ by.mixer.T):
            chi = f.C @ z + f.offset[i]
            chi = chi + f.reaction(x[7:13]) if f.reaction else chi
            z = f.A @ z + f.B @ x[7:13]
            x = condensed.dynamics.advance(x, u, chi)
            course.append(x)
            total += (u - h.u_ref[i]) ** 2 @ condensed.R + c.weight_swing * chi[:2] @ chi[:2]
            last, e = i == c.horizon - 1, x - h.x_ref[i + 1]
            total += e @ h.P @ e if last else e**2 @ c.Q
        s = condensed.objective.slacks(condensed.objective.excess(h, np.array(course)))
        return total + c.slack_weight * np.sum(s + 0.1 * s**2)

    start = (solution.u @ by.unmixer.T).ravel()
    bounds = list(zip(np.tile(by.lower, c.horizon), np.tile(by.upper, c.horizon), strict=True))
    assert cost(start) == pytest.approx(solution.cost, rel=1e-8, abs=1e-12)
    shaken = start + 0.02 * np.random.default_rng(0).normal(size=start.size)
    lower, upper = np.transpose(bounds)
    found = [minimize(cost, np.clip(p, lower, upper), bounds=bounds).fun for p in (start, shaken)]
    return min(found)


@pytest.fixture(scope="session")
def least_cost():
    """See `_least_cost`."""
    return _least_cost
