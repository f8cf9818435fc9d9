"""A flight that obeys Newton's law exactly, with forces that the nominal model lacks."""

from collections.abc import Callable

import numpy as np

from np_drake import attitude
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle

STEP = 0.01  # s


def flight(
    seed: int,
    force: Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray],
    duration: float = 12.0,
) -> FlightLog:
    """Fly a multisine whose rotors carry what `force` (t, p, v, a) in W leaves of m (a + g)."""
    vehicle = Vehicle()
    t = STEP * np.arange(int(duration / STEP))
    draw = np.random.default_rng(seed)
    frequency = draw.uniform(1.0, 4.0, (4, 1, 3))
    phase = frequency * t[None, :, None] + draw.uniform(0, 2 * np.pi, (4, 1, 3))
    size = np.array([0.35, 0.35, 0.1])
    p = np.sum(-size / frequency * np.cos(phase), axis=0)
    v = np.sum(size * np.sin(phase), axis=0)
    a = np.sum(size * frequency * np.cos(phase), axis=0)
    thrust = vehicle.mass * (a + [0.0, 0.0, vehicle.gravity]) - force(t, p, v, a)
    z = thrust / np.linalg.norm(thrust, axis=1, keepdims=True)
    half = np.stack(
        [1 + z[:, 2], -z[:, 1], z[:, 0], np.zeros(len(t))], axis=1
    )  # least turn of z to the thrust
    q = half / np.linalg.norm(half, axis=1, keepdims=True)
    turn = attitude.rotation_vector(attitude.multiply(attitude.conjugate(q[:-2]), q[2:])) / (
        2 * STEP
    )
    w = np.concatenate([turn[:1], turn, turn[-1:]])
    al = np.gradient(w, STEP, axis=0)
    tau = al @ vehicle.J.T + np.cross(w, w @ vehicle.J.T)
    u = np.column_stack([np.linalg.norm(thrust, axis=1), tau])
    u[:-1] = 0.5 * (u[:-1] + u[1:])  # a row's command acts until the next
    noise = np.random.default_rng(seed + 1000)
    return FlightLog(
        t=t,
        p=p + 1e-4 * noise.normal(size=p.shape),
        q=q,
        v=v + 1e-3 * noise.normal(size=v.shape),
        w=w,
        u=u,
        name=f"made_{seed}",
    )
