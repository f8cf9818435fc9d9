"""Made-up flights with a payload: prescribed motion, a finely integrated tether."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.effects.pendulum import swing_many
from np_drake.payload_filter.model_file import PayloadFilterModel
from np_drake.residual_model import Sample
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import scales

STEP, FINE, G, MASS = 0.02, 20, 9.81, 2.0  # sample [s], substeps [1], gravity [m/s²], vehicle [kg]
HOOK = np.array([0.0, 0.0, -0.025])  # [m]


def model(*, thrust_error=0.0, drag=0.125, hook=HOOK, deviation=0.01) -> PayloadFilterModel:
    """The vehicle as trained."""
    arm = scales(Vehicle()).length
    return PayloadFilterModel(
        STEP, MASS, G, 0.0, thrust_error, deviation, drag, 0.02, np.array(hook, float), arm=arm
    )


@dc.dataclass
class Flown:
    """Samples, and the true pull of the tether [N] and payload from the hook [m], (n, 3)."""

    samples: list[Sample]
    pull: np.ndarray
    r: np.ndarray
    x: np.ndarray
    u: np.ndarray


def flown(
    *,
    mass=0.26,
    length=0.8,
    seconds=12.0,
    radius=0.0,
    speed=1.5,
    swing=0.0,
    noise=0.05,
    thrust_error=0.0,
    drag=0.125,
    dither=0.0,
    seed=0,
    torque_noise=0.002,
) -> Flown:
    """A circle of `radius` [m] at `speed` [m/s], or hover where it is 0, with the tether at `swing`
    [rad] at first.

    mass: [kg], or (n,) of each sample: 0 while nothing hangs.   noise: of the force label [N].
    dither: amplitude of a slow shaking along every axis [m].
    """
    n = round(seconds / STEP) + 1
    fine = STEP / FINE * np.arange((n - 1) * FINE + 1)
    p = np.zeros((len(fine), 3))
    if radius:
        angle = speed / radius * fine
        p = radius * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    p = p + dither * np.stack([np.sin(k * fine) for k in (5.0, 3.7, 4.3)], axis=1)
    v = np.gradient(p, fine, axis=0, edge_order=2)
    a = np.gradient(v, fine, axis=0, edge_order=2)
    start = length * np.array([[np.sin(swing), 0.0, -np.cos(swing)]])
    middle = 0.5 * (a[1:] + a[:-1])
    step = STEP / FINE
    held = swing_many(np.array([length]), start, np.zeros((1, 3)), middle, step, G)[:, 0]
    specific = np.concatenate([held[:1], 0.5 * (held[1:] + held[:-1]), held[-1:]])
    turned = np.cumsum(-step * (held + middle + [0.0, 0.0, G]), axis=0)  # of hook to payload
    swung = step * (np.vstack([np.zeros(3), turned[:-1]]) + turned) / 2
    path = start + np.vstack([np.zeros(3), np.cumsum(swung, axis=0)])
    at = slice(None, None, FINE)
    masses = np.broadcast_to(np.asarray(mass, float), n)
    pull, r = masses[:, None] * specific[at], path[at]
    v, a, p = v[at], a[at], p[at]
    lift = (MASS * (a + [0.0, 0.0, G]) - pull + drag * MASS * v) / (1.0 + thrust_error)
    f = np.linalg.norm(lift, axis=1)
    z = lift / f[:, None]
    q = np.stack([1.0 + z[:, 2], -z[:, 1], z[:, 0], np.zeros(n)], axis=1)
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    x = np.concatenate([p, q, v, np.zeros((n, 3))], axis=1)
    u = np.column_stack([f, np.zeros((n, 3))])
    draw = np.random.default_rng(seed)
    chi = np.zeros((n, 6))
    chi[:, :3] = MASS * (a + [0.0, 0.0, G]) - lift + noise * draw.normal(size=(n, 3))
    chi[:, 3:] = np.cross(HOOK, attitude.rotate_back(q, pull)) + torque_noise * draw.normal(
        size=(n, 3)
    )
    between = np.vstack([u[:1], 0.5 * (u[1:] + u[:-1])])
    return Flown([Sample(*row) for row in zip(x, between, chi, strict=True)], pull, r, x, u)
