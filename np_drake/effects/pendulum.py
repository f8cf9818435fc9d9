"""A taut payload under a moving hook: the wrench it puts on the quadrotor."""

import dataclasses as dc

import numpy as np

from np_drake import attitude


@dc.dataclass(frozen=True)
class Payload:
    """A point mass on a massless, inextensible tether."""

    mass: float = 0.26  # [kg]
    length: float = 0.8  # [m]
    hook: tuple[float, float, float] = (0.0, 0.0, -0.025)  # p_BoTo_B [m]


def tether_force(
    payload: Payload, r: np.ndarray, r_rate: np.ndarray, a_hook: np.ndarray, gravity: float
) -> np.ndarray:
    """(..., 3) force on the hook in W [N]; zero where the tether would have to push.

    With r = p_ToPo_W, |r| = L, the constraint r · r'' = -|r'|² gives T/m = |r'|²/L - (r/L) · (g z + a_hook).
    Args: r, r_rate: (..., 3) payload from hook and its rate [m, m/s]; a_hook: (..., 3) of the hook [m/s²].
    """
    n = r / np.linalg.norm(r, axis=-1, keepdims=True)
    specific = np.sum(r_rate**2, axis=-1) / payload.length - np.sum(n * a_hook, axis=-1)
    specific = specific - gravity * n[..., 2]
    return payload.mass * np.maximum(specific, 0.0)[..., None] * n


def swing(
    payload: Payload, r: np.ndarray, r_rate: np.ndarray, a_hook: np.ndarray, step: float, gravity: float
) -> np.ndarray:
    """(n, 3) force on the hook [N] in the middle of n steps with hook acceleration `a_hook` (n, 3).

    From r, r_rate (3,) at the start; explicit midpoint, returned to the sphere |r| = L after every step.
    """
    forces = np.empty_like(a_hook)
    weight = np.array([0.0, 0.0, gravity])
    for i, a in enumerate(a_hook):
        pull = tether_force(payload, r, r_rate, a, gravity)
        r_mid = r + 0.5 * step * r_rate
        rate_mid = r_rate + 0.5 * step * (-pull / payload.mass - a - weight)
        forces[i] = tether_force(payload, r_mid, rate_mid, a, gravity)
        r = r + step * rate_mid
        r_rate = r_rate + step * (-forces[i] / payload.mass - a - weight)
        r = r * (payload.length / np.linalg.norm(r))
        r_rate = r_rate - r * (r @ r_rate) / payload.length**2
    return forces


def hook_wrench(payload: Payload, q: np.ndarray, force_W: np.ndarray) -> np.ndarray:
    """(..., 6) chi of a force (..., 3) in W that acts at the hook [N, N·m]."""
    tau = np.cross(np.array(payload.hook), attitude.rotate_back(q, force_W))
    return np.concatenate([force_W, tau], axis=-1)
