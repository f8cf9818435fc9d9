"""Benchmark problems without a simulator: closed-loop tracking, cold starts, infeasible starts."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.mpc.controller import shift
from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcSolution
from np_drake.mpc.sqp import SqpSolver
from np_drake.residual_model import WrenchForecast
from np_drake.vehicle import Vehicle

_TRUE_WRENCH = np.array([0.4, -0.3, -2.0, 0.01, -0.01, 0.002])  # that pulls at the vehicle [N, N·m]


def tracking_problems(
    vehicle: Vehicle,
    config: MpcConfig,
    *,
    count: int = 200,
    period: float = 0.02,
    lifted: int = 24,
    seed: int = 0,
) -> list[MpcProblem]:
    """Return the problems of a closed loop on the circle.

    The vehicle is 5 % heavier than the controller's and pulled by an oscillating wrench. Every
    problem has its own stable A, B, C (K = `lifted`), whose forecast starts at the true wrench.

    Args:
        period: time between them [s].
    """
    rng = np.random.default_rng(seed)
    plant = DiscreteDynamics(vehicle.with_mass(1.05 * vehicle.mass), period)
    solver = SqpSolver(vehicle, config, time_limit=np.inf)
    plan: MpcSolution | None = None
    base = _base_model(rng, lifted)
    x = circle(vehicle, np.zeros(1))[0][0]
    problems = []
    for k in range(count):
        chi = _TRUE_WRENCH * (1 + 0.3 * np.sin(3.5 * k * period))
        measured = x + rng.normal(size=13) * np.repeat([0.001, 0.0, 0.01, 0.01], [3, 4, 3, 3])
        x_ref, u_ref = circle(vehicle, k * period + config.step * np.arange(config.horizon + 1))
        forecast = _forecast(rng, base, chi, config.horizon)
        problems.append(MpcProblem(measured, x_ref, u_ref[:-1], forecast))
        warm = None if plan is None else shift(plan, elapsed=period, step=config.step)
        plan = solver.solve(problems[-1], warm)
        x = plant.advance(x, plan.u[0], chi)
    return problems


def cold_problems(vehicle: Vehicle, config: MpcConfig, count: int) -> list[MpcProblem]:
    """Return scattered starts within the sets: about 0.3 m, 0.5 m/s, 15 deg, 0.5 rad/s from the
    circle.
    """
    rng = np.random.default_rng(1)
    problems = tracking_problems(vehicle, config, count=count, seed=1)
    return [dc.replace(p, x0=_scatter(rng, p.x0, [0.3, 0.5, 0.25, 0.5])) for p in problems]


def infeasible_problems(vehicle: Vehicle, config: MpcConfig, count: int) -> list[MpcProblem]:
    """Return starts far outside every soft set: 9 m/s, 80 deg of tilt, metres away, tumbling."""
    rng = np.random.default_rng(2)
    problems = []
    for p in tracking_problems(vehicle, config, count=count, seed=2):
        x0 = _scatter(rng, p.x0, [4.0, 0.0, 0.0, 3.0])
        heading = rng.normal(size=3)
        x0[7:10] = 9.0 * heading / np.linalg.norm(heading)
        turn = rng.uniform(0, 2 * np.pi)
        tilt = np.radians(80.0)
        axis = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
        x0[3:7] = attitude.quaternion_from_axes(axis, 0.0)
        problems.append(dc.replace(p, x0=x0))
    return problems


def circle(vehicle: Vehicle, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return x_ref (n, 13) and u_ref (n, 4) on a circle of 1 m at 1.5 m/s, 1.6 m high.

    Args:
        t: (n,) times [s].
    """
    c, s, zero = np.cos(1.5 * t), np.sin(1.5 * t), np.zeros_like(t)
    push = np.stack([-2.25 * c, -2.25 * s, zero + vehicle.gravity], axis=1)
    size = np.linalg.norm(push, axis=1)
    q = attitude.quaternion_from_axes(push / size[:, None], 0.0)
    p, v = np.stack([c, s, zero + 1.6], axis=1), np.stack([-1.5 * s, 1.5 * c, zero], axis=1)
    u = np.zeros((len(t), 4))
    u[:, 0] = vehicle.mass * size
    return np.concatenate([p, q, v, np.zeros_like(p)], axis=1), u


def _base_model(rng: np.random.Generator, K: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return A with spectral radius 0.97, B, C, for wrenches of newtons and hundredths of newton
    metres.
    """
    A = rng.normal(size=(K, K))
    A *= 0.97 / np.abs(np.linalg.eigvals(A)).max() if K else 1.0
    scale = np.array([1.0, 1.0, 1.0, 0.02, 0.02, 0.02])
    return (
        A,
        0.05 * rng.normal(size=(K, 6)),
        scale[:, None] * rng.normal(size=(6, K)) / np.sqrt(max(K, 1)),
    )


def _forecast(rng: np.random.Generator, base, chi: np.ndarray, horizon: int) -> WrenchForecast:
    """Return the base model refitted.

    Each matrix is 1 % off at every step, and z is the least one whose wrench is chi.
    """
    A, B, C = (M * (1 + 0.01 * rng.normal(size=M.shape)) for M in base)
    if len(A) == 0:
        return WrenchForecast(A, B, C, np.zeros(0), np.tile(chi, (horizon, 1)))
    A *= min(1.0, 0.98 / np.abs(np.linalg.eigvals(A)).max())
    return WrenchForecast(A, B, C, np.linalg.pinv(C) @ chi, np.zeros((horizon, 6)))


def _scatter(rng: np.random.Generator, x: np.ndarray, size: list[float]) -> np.ndarray:
    """Return the state x moved by normal errors of position [m], velocity [m/s], attitude [rad] and
    rate [rad/s].
    """
    x = x.copy()
    x[0:3] += size[0] * rng.normal(size=3)
    x[7:10] += size[1] * rng.normal(size=3)
    turn = 0.5 * size[2] * rng.normal(size=3)
    x[3:7] = attitude.multiply(x[3:7], np.concatenate([[1.0], turn]) / np.sqrt(1 + turn @ turn))
    x[10:13] += size[3] * rng.normal(size=3)
    return x
