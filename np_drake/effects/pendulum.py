"""A payload under a moving hook: its wrench on the quadrotor, for one pendulum or many at once."""

import dataclasses as dc
from collections.abc import Callable, Mapping

import numpy as np
from numba import njit

from np_drake import attitude
from np_drake.rigid_body import Q, W


@dc.dataclass(frozen=True)
class Payload:
    """Point mass on a massless, inextensible tether."""

    mass: float = 0.26  # [kg]
    length: float = 0.8  # [m]
    hook: tuple[float, float, float] = (0.0, 0.0, -0.025)  # p_BoTo_B [m]


def tether_force(
    payload: Payload, r: np.ndarray, r_rate: np.ndarray, a_hook: np.ndarray, gravity: float
) -> np.ndarray:
    """Return the force on the hook in W, (..., 3) [N]; zero where the tether would have to push.

    With r = p_ToPo_W, |r| = L, the constraint r · r'' = -|r'|² gives T/m = |r'|²/L - (r/L) · (g z + a_hook).
    Args: r, r_rate: (..., 3) payload from hook and its rate [m, m/s]; a_hook: (..., 3) of the hook [m/s²]; gravity:
    [m/s²].
    """
    n = r / np.linalg.norm(r, axis=-1, keepdims=True)
    specific = np.sum(r_rate**2, axis=-1) / payload.length - np.sum(n * a_hook, axis=-1)
    specific = specific - gravity * n[..., 2]
    return payload.mass * np.maximum(specific, 0.0)[..., None] * n


def swing_many(
    lengths: np.ndarray,
    r: np.ndarray,
    r_rate: np.ndarray,
    a_hook: np.ndarray,
    step: float,
    gravity: float,
    jumps: Mapping[int, np.ndarray] | None = None,
) -> np.ndarray:
    """Return the force on the hook per mass of the payload, (n, m, 3) [m/s²], in the middle of n steps, of m pendulums.

    Leapfrog: positions in the middle of steps, velocities between; the tether's pull along r is the least that keeps
    the next position within |r| <= L, so a slack payload flies freely and a tether that snaps taut takes the outward
    speed. Second order in the step; no drift of energy.   Source: SHAKE, its quadratic solved in closed form.

    Args:
        lengths: (m,) [m].   r, r_rate: (m, 3) p_ToPo_W and its rate at the start [m, m/s].
        a_hook: (n, 3) of the one hook, or (n, m, 3), held over each step [m/s²].   step: [s].   gravity: [m/s²].
        jumps: before these steps the swing jumps by (m, 4) angles [rad] and rates [rad/s] about the axes of `across`.
    """
    limit = np.square(lengths)
    now, move = _start(lengths, np.transpose(r), np.transpose(r_rate), step)
    kicks = (-(step**2) * (a_hook + np.array([0.0, 0.0, gravity]))).reshape(len(a_hook), -1, 3)
    kicks = np.ascontiguousarray(kicks.transpose(0, 2, 1))
    pulls = np.empty((len(a_hook), *now.shape))
    begin = 0
    for k in sorted(jumps or {}):
        _leapfrog(limit, now, move, kicks[begin:k], pulls[begin:k])
        _jump(now, move, jumps[k], step)  # type: ignore[index]
        begin = k
    _leapfrog(limit, now, move, kicks[begin:], pulls[begin:])
    pulls /= step**2
    return pulls.transpose(0, 2, 1)


def _start(lengths, r, r_rate, step) -> tuple[np.ndarray, np.ndarray]:
    """Return the position half a step later, within reach, and the displacement per step, (3, m) each [m].

    A taut tether takes up outward speed.
    """
    span = np.linalg.norm(r, axis=0)
    n = r / np.maximum(span, 1e-12)
    outward = np.maximum(np.sum(n * r_rate, axis=0), 0.0)
    move = step * (r_rate - np.where(span >= lengths * (1 - 1e-9), outward, 0.0) * n)
    middle = np.minimum(span, lengths) * n + 0.5 * move
    reach = np.minimum(1.0, lengths / np.maximum(np.linalg.norm(middle, axis=0), 1e-12))
    return np.ascontiguousarray(middle * reach), np.ascontiguousarray(move)


def across(n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors (..., 3) across n (..., 3) and each other, x and y of W where n points down."""
    e_x = np.cross([0.0, 1.0, 0.0], -n)
    e_x = e_x / np.maximum(np.linalg.norm(e_x, axis=-1, keepdims=True), 1e-9)
    return e_x, np.cross(-n, e_x)


def _jump(now, move, jump, step) -> None:
    """Change position (3, m) and displacement per step (3, m) by a jump (m, 4); the length stays."""
    span = np.maximum(np.linalg.norm(now, axis=0), 1e-12)
    e_x, e_y = (e.T for e in across((now / span).T))
    a, b, a_rate, b_rate = jump.T
    turned = now + span * (a * e_x + b * e_y)
    now[:] = span * turned / np.maximum(np.linalg.norm(turned, axis=0), 1e-12)
    move += step * span * (a_rate * e_x + b_rate * e_y)


def _compiled(function: Callable) -> Callable:
    """Return the function compiled, once for all processes; where no cache can be written, once for each."""
    try:
        return njit(cache=True, error_model="numpy")(function)
    except RuntimeError:
        return njit(error_model="numpy")(function)


@_compiled
def _leapfrog(limit, now, move, kicks, pulls):
    """Write pull = mu now (n, 3, m) [m], the least mu >= 0 with |now + move + kick - mu now|² <= limit = L².

    With b = now + move + kick:  mu = (b² - L²) / (now·b + sqrt((now·b)² - now² (b² - L²))).  Changes now and move.
    Compiled: a payload takes a thousand short steps, each of which needs the one before it.
    """
    for i in range(now.shape[1]):
        x, y, z = now[0, i], now[1, i], now[2, i]
        u, v, w = move[0, i], move[1, i], move[2, i]
        own = min(i, kicks.shape[2] - 1)
        square = x * x + y * y + z * z
        for k in range(len(kicks)):
            u, v, w = u + kicks[k, 0, own], v + kicks[k, 1, own], w + kicks[k, 2, own]
            a, b, c = x + u, y + v, z + w
            along, far = x * a + y * b + z * c, a * a + b * b + c * c
            mu = 0.0
            if far > limit[i]:
                excess = far - limit[i]
                mu = max(0.0, excess / (along + np.sqrt(max(0.0, along * along - square * excess))))
            pulls[k, 0, i], pulls[k, 1, i], pulls[k, 2, i] = mu * x, mu * y, mu * z
            u, v, w = u - mu * x, v - mu * y, w - mu * z
            x, y, z = x + u, y + v, z + w
            square = min(far, limit[i])
        now[0, i], now[1, i], now[2, i] = x, y, z
        move[0, i], move[1, i], move[2, i] = u, v, w


def swing(
    payload: Payload, r: np.ndarray, r_rate: np.ndarray, a_hook: np.ndarray, step: float, gravity: float
) -> np.ndarray:
    """Return the force on the hook (n, 3) [N] in the middle of n steps with hook acceleration `a_hook` (n, 3) [m/s²].

    This is `swing_many` of one pendulum.
    Args: r, r_rate: (3,) at the start [m, m/s].   step: [s].   gravity: [m/s²].
    """
    length = np.array([payload.length])
    return payload.mass * swing_many(length, r[None], r_rate[None], a_hook, step, gravity)[:, 0]


def hook_acceleration(hook, x: np.ndarray, a: np.ndarray, al: np.ndarray) -> np.ndarray:
    """Return the acceleration of the hook p_BoTo_B (3,) in W, (..., 3) [m/s²].

    Args: x (..., 13); a (..., 3) of Bo in W [m/s²]; al (..., 3) in B [rad/s²].
    """
    p_BoTo_B, w = np.asarray(hook, float), x[..., W]
    return a + attitude.rotate(x[..., Q], np.cross(al, p_BoTo_B) + np.cross(w, np.cross(w, p_BoTo_B)))


def hook_wrench(payload: Payload, q: np.ndarray, force_W: np.ndarray) -> np.ndarray:
    """Return chi (..., 6) [N, N·m] of force_W (..., 3) in W at the hook, for attitudes q (..., 4)."""
    tau = np.cross(np.array(payload.hook), attitude.rotate_back(q, force_W))
    return np.concatenate([force_W, tau], axis=-1)
