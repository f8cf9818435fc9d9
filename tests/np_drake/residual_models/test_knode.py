import numpy as np
import pytest
import torch

from np_drake.flight_log import FlightLog
from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.residual_models.predictor_training import KnodeConfig, fit_knode, rollout
from np_drake.vehicle import Vehicle

VEHICLE, STEP = Vehicle(), 0.02
SMALL = KnodeConfig(width=32, window=3, epochs=50, batch=80, learning_rate=1e-2)


def dragged(zeta: np.ndarray) -> np.ndarray:
    """A hanging load and a linear drag, in force and torque [N, N·m]."""
    return np.concatenate([[0, 0, -2.5] - 0.3 * zeta[..., :3], -0.01 * zeta[..., 3:]], axis=-1)


def flown(seed: int, n: int = 4) -> FlightLog:
    """A short flight under random commands, the wrench renewed eight times a step."""
    rng = np.random.default_rng(seed)
    fine = DiscreteDynamics(VEHICLE, STEP / 8)
    x = np.concatenate([np.zeros(3), [1.0, 0, 0, 0] + 0.2 * rng.normal(size=4), rng.normal(size=6)])
    x[3:7] /= np.linalg.norm(x[3:7])
    rows, commands = [x], VEHICLE.hover_input + rng.normal(size=(n, 4)) * [3.0, 0.05, 0.05, 0.02]
    for u in commands[:-1]:
        for _ in range(8):
            x = np.array(fine.advance(x.tolist(), u.tolist(), dragged(x[7:13]).tolist()))
        rows.append(x)
    return FlightLog(STEP * np.arange(n), *np.split(np.array(rows), [3, 7, 10], axis=1), commands)


@pytest.fixture(scope="module")
def logs():
    return [flown(seed) for seed in range(240)]


def test_the_ode_is_the_one_that_the_controller_plans_with(logs):
    chi = np.array([0.3, -0.2, -2.0, 0.01, 0.02, -0.01])
    x, u = logs[0].x[0], logs[0].u
    start, commands = torch.from_numpy(x)[None], torch.from_numpy(u)[None]
    zeta = rollout(VEHICLE, STEP, start, commands, lambda _: torch.from_numpy(chi)[None])[0].numpy()
    dynamics = DiscreteDynamics(VEHICLE, STEP)
    for command, expected in zip(u, zeta, strict=True):
        x = np.array(dynamics.advance(x.tolist(), command.tolist(), chi.tolist()))
        np.testing.assert_allclose(x[7:13], expected, atol=1e-12)  # [m/s, rad/s] round-off


@pytest.fixture(scope="module")
def trained(logs):
    return fit_knode(logs, VEHICLE, SMALL)


def test_a_known_linear_drag_is_recovered_from_motion_alone(trained):
    dut, loss = trained
    zeta = 0.7 * np.random.default_rng(99).normal(size=(200, 6))
    rmse = np.sqrt(np.mean((dut(zeta) - dragged(zeta)) ** 2, axis=0))
    slope = dut.jacobian(zeta).mean(axis=0)
    np.testing.assert_allclose(
        slope[:3, :3], -0.3 * np.eye(3), atol=0.04
    )  # [N·s/m] 800 steps of flight
    np.testing.assert_allclose(slope[3:, 3:], -0.01 * np.eye(3), atol=0.0015)  # [N·m·s/rad]
    assert rmse[:3].max() < 0.1  # [N] half the drag's RMS: the edges of few ReLUs
    assert rmse[3:].max() < 0.004  # [N·m] likewise
    assert loss[-1] < 0.01  # [1] of what the nominal model misses
