"""A payload under a moving hook: its wrench on the quadrotor, for one pendulum or many at once."""

import dataclasses as dc
from collections.abc import Mapping

import numpy as np

from np_drake import attitude
from np_drake.compiled import compiled
from np_drake.rigid_body import P, Q, V, W


@dc.dataclass(frozen=True)
class Payload:
    """Point mass on a massless, inextensible tether in still air."""

    mass: float = 0.26  # [kg]
    length: float = 0.8  # [m]
    hook: tuple[float, float, float] = (0.0, 0.0, -0.025)  # p_BoTo_B [m]
    damping: float = 0.0  # drag over mass and velocity in W [1/s]


def tether_force(
    payload: Payload,
    r: np.ndarray,
    r_rate: np.ndarray,
    a_hook: np.ndarray,
    gravity: float,
    v_hook: np.ndarray | None = None,
) -> np.ndarray:
    """Return the force on the hook in W, (..., 3) [N]; zero where the tether would have to push.

    With r = p_ToPo_W, |r| = L, the constraint r · r'' = -|r'|² gives T/m = |r'|²/L - (r/L) · (g z +
    a_hook + c v_hook).

    Args:
        r: (..., 3) payload from hook [m].
        r_rate: (..., 3) its rate [m/s].
        a_hook: (..., 3) acceleration of the hook [m/s²].
        gravity: [m/s²].
        v_hook: (..., 3) velocity of the hook [m/s]; default: at rest.
    """
    n = r / np.linalg.norm(r, axis=-1, keepdims=True)
    pushed = a_hook if v_hook is None else a_hook + payload.damping * v_hook
    specific = np.sum(r_rate**2, axis=-1) / payload.length - np.sum(n * pushed, axis=-1)
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
    *,
    damping: float | np.ndarray = 0.0,
    v_hook: np.ndarray | None = None,
) -> np.ndarray:
    """Return the force on the hook per mass of the payload, (n, m, 3) [m/s²], in the middle of n
    steps, of m pendulums.

    With c the damping:  r'' = -g z - a_hook - c (r' + v_hook) - (T/m) r/|r|.
    Leapfrog: positions in the middle of steps, velocities between; the tether's pull along r is the
    least that keeps the next position within |r| <= L, so a slack payload flies freely and a tether
    that snaps taut takes the outward speed. Second order in the step; without damping no drift of
    energy.
    Source: SHAKE, its quadratic solved in closed form; the drag of a step is that of the mean of
        its two velocities (implicit midpoint).

    Args:
        lengths: (m,) [m].
        r: (m, 3) p_ToPo_W at the start [m].
        r_rate: (m, 3) its rate [m/s].
        a_hook: (n, 3) of the one hook, or (n, m, 3), held over each step [m/s²].
        step: [s].
        gravity: [m/s²].
        jumps: before these steps the swing jumps by (m, 4) angles [rad] and rates [rad/s] about the
            axes of `across`.
        damping: of all or of each, (m,) [1/s].
        v_hook: (n, 3) or (n, m, 3) velocity of the hook in W in the middle of each step [m/s];
            default: at rest.
    """
    now, move = _start(lengths, np.transpose(r), np.transpose(r_rate), step)
    swings = _Swings(lengths, a_hook, step, gravity, damping, v_hook)
    begin = 0
    for k in sorted(jumps or {}):
        swings.run(now, move, slice(begin, k))
        _jump(now, move, jumps[k], step)  # type: ignore[index]
        begin = k
    swings.run(now, move, slice(begin, None))
    return swings.pulls.transpose(0, 2, 1) / step**2


class _Swings:
    """What drives m pendulums over n steps, in the form that `leapfrog` takes, and `pulls` (n, 3,
    m) [m].
    """

    def __init__(self, lengths, a_hook, step, gravity, damping, v_hook):
        self._limit = np.square(lengths)
        self._half = 0.5 * step * np.broadcast_to(np.asarray(damping, float), self._limit.shape)
        self._kicks = _by_axis(-(step**2) * (a_hook + np.array([0.0, 0.0, gravity])))
        self._drift = _by_axis(step * (np.zeros((len(a_hook), 3)) if v_hook is None else v_hook))
        self.pulls = np.empty((len(a_hook), 3, len(self._limit)))

    def run(self, now: np.ndarray, move: np.ndarray, steps: slice) -> None:
        """Take these steps; changes now and move (3, m) [m], and fills their pulls."""
        leapfrog(
            self._limit,
            self._half,
            now,
            move,
            self._kicks[steps],
            self._drift[steps],
            self.pulls[steps],
        )


def _by_axis(values: np.ndarray) -> np.ndarray:
    """Return values (n, 3) or (n, m, 3) as (n, 3, 1) or (n, 3, m)."""
    return np.ascontiguousarray(values.reshape(len(values), -1, 3).transpose(0, 2, 1))


def _start(lengths, r, r_rate, step) -> tuple[np.ndarray, np.ndarray]:
    """Return the position half a step later, within reach, and the displacement per step, (3, m)
    each [m].

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
    """Return two unit vectors (..., 3) across n (..., 3) and each other, x and y of W where n
    points down.
    """
    x, y, z = np.moveaxis(n, -1, 0)
    span = np.maximum(np.hypot(x, z), 1e-9)
    a = -z / span
    c = x / span
    return np.stack([a, 0.0 * a, c], axis=-1), np.stack([-y * c, x * c - z * a, y * a], axis=-1)


def _jump(now, move, jump, step) -> None:
    """Change position (3, m) and displacement per step (3, m) by a jump (m, 4); the length
    stays.
    """
    span = np.maximum(np.linalg.norm(now, axis=0), 1e-12)
    e_x, e_y = (e.T for e in across((now / span).T))
    a, b, a_rate, b_rate = jump.T
    turned = now + span * (a * e_x + b * e_y)
    now[:] = span * turned / np.maximum(np.linalg.norm(turned, axis=0), 1e-12)
    move += step * span * (a_rate * e_x + b_rate * e_y)


@compiled
def leapfrog(limit, half, now, move, kicks, drift, pulls):
    """Write pull = (1 + d) mu now, the least mu >= 0 with |b - mu now|² <= limit = L², step by
    step.

    With d = half = c step / 2 and b = now + ((1 - d) move + kick - 2 d drift) / (1 + d):
    mu = (b² - L²) / (now·b + sqrt((now·b)² - now² (b² - L²))).
    Compiled: a payload takes a thousand short steps, each of which needs the one before it.

    Args:
        limit: (m,) squares of the lengths [m²].
        half: (m,) half the damping of a step [1].
        now: (3, m) position, which is moved on [m].
        move: (3, m) displacement per step, moved on as well [m].
        kicks: (n, 3, m or 1) by acceleration of the hook [m].
        drift: (n, 3, m or 1) by its velocity [m].
        pulls: (n, 3, m) to be written [m].
    """
    for i in range(now.shape[1]):
        kick_column = min(i, kicks.shape[2] - 1)
        drift_column = min(i, drift.shape[2] - 1)
        both = 2 * half[i]
        kept = 1 - half[i]
        more = 1 + half[i]
        share = 1 / more
        x = now[0, i]
        y = now[1, i]
        z = now[2, i]
        u = move[0, i]
        v = move[1, i]
        w = move[2, i]
        square = x * x + y * y + z * z
        for k in range(len(kicks)):
            u = share * (kept * u + kicks[k, 0, kick_column] - both * drift[k, 0, drift_column])
            v = share * (kept * v + kicks[k, 1, kick_column] - both * drift[k, 1, drift_column])
            w = share * (kept * w + kicks[k, 2, kick_column] - both * drift[k, 2, drift_column])
            mu, square = _tension((x, y, z), (x + u, y + v, z + w), square, limit[i])
            pull = more * mu
            pulls[k, 0, i] = pull * x
            pulls[k, 1, i] = pull * y
            pulls[k, 2, i] = pull * z
            u = u - mu * x
            v = v - mu * y
            w = w - mu * z
            x = x + u
            y = y + v
            z = z + w
        now[0, i] = x
        now[1, i] = y
        now[2, i] = z
        move[0, i] = u
        move[1, i] = v
        move[2, i] = w


@compiled
def _tension(now, ahead, square, limit):
    """Return mu of `leapfrog`, and the square of the next position.

    Args:
        now: three numbers [m].
        ahead: where a slack payload would go, three numbers [m].
        square: of the position now [m²].
        limit: square of the length [m²].
    """
    along = now[0] * ahead[0] + now[1] * ahead[1] + now[2] * ahead[2]
    far = ahead[0] * ahead[0] + ahead[1] * ahead[1] + ahead[2] * ahead[2]
    mu = 0.0
    if far > limit:
        excess = far - limit
        mu = max(0.0, excess / (along + np.sqrt(max(0.0, along * along - square * excess))))
    return mu, min(far, limit)


def hanging(
    offset: np.ndarray, rate: np.ndarray, length: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return p_ToPo_W and its rate (m, 3) of taut tethers [m, m/s].

    Args:
        offset: (m, 2) to the side [m].
        rate: (m, 2) of that [m/s].
        length: (m,) or of all [m].
    """
    length = np.broadcast_to(length, offset.shape[:1])[:, None]
    far = np.linalg.norm(offset, axis=-1, keepdims=True)
    offset = offset * np.minimum(1.0, 0.99 * length / np.maximum(far, 1e-12))
    down = -np.sqrt(length**2 - np.sum(offset**2, axis=-1, keepdims=True))
    sinking = -np.sum(offset * rate, axis=-1, keepdims=True) / down
    return np.concatenate([offset, down], axis=-1), np.concatenate([rate, sinking], axis=-1)


def swing(
    payload: Payload,
    r: np.ndarray,
    r_rate: np.ndarray,
    a_hook: np.ndarray,
    step: float,
    gravity: float,
    v_hook: np.ndarray | None = None,
) -> np.ndarray:
    """Return the force on the hook (n, 3) [N] in the middle of n steps: `swing_many` of one
    pendulum.

    Args:
        r: (3,) p_ToPo_W at the start [m].
        r_rate: (3,) its rate [m/s].
        a_hook: (n, 3) [m/s²].
        step: [s].
        gravity: [m/s²].
        v_hook: (n, 3) in W [m/s]; default: at rest.
    """
    length = np.array([payload.length])
    start = (r[None], r_rate[None])
    damping = payload.damping
    pull = swing_many(length, *start, a_hook, step, gravity, damping=damping, v_hook=v_hook)
    return payload.mass * pull[:, 0]


def hook_velocity(hook, x: np.ndarray) -> np.ndarray:
    """Return the velocity of the hook in W, (..., 3) [m/s].

    Args:
        hook: (3,) p_BoTo_B [m].
        x: (..., 13) state.
    """
    return x[..., V] + attitude.rotate(x[..., Q], np.cross(x[..., W], np.asarray(hook, float)))


def hanging_still(hook, x: np.ndarray, length: float) -> np.ndarray:
    """Return position and velocity in W of a payload that hangs still under the moving hook, (6,)
    [m, m/s].

    Args:
        hook: (3,) p_BoTo_B [m].
        x: (13,) state.
        length: of the tether as it is stretched [m].
    """
    p_WP = x[P] + attitude.rotate(x[Q], np.asarray(hook, float)) - [0.0, 0.0, length]
    return np.concatenate([p_WP, hook_velocity(hook, x)])


def hook_acceleration(hook, x: np.ndarray, a: np.ndarray, al: np.ndarray) -> np.ndarray:
    """Return the acceleration of the hook in W, (..., 3) [m/s²].

    Args:
        hook: (3,) p_BoTo_B [m].
        x: (..., 13) state.
        a: (..., 3) of Bo in W [m/s²].
        al: (..., 3) in B [rad/s²].
    """
    p_BoTo_B = np.asarray(hook, float)
    w = x[..., W]
    return a + attitude.rotate(
        x[..., Q], np.cross(al, p_BoTo_B) + np.cross(w, np.cross(w, p_BoTo_B))
    )


def hook_wrench(payload: Payload, q: np.ndarray, force_W: np.ndarray) -> np.ndarray:
    """Return chi (..., 6) of a force at the hook [N, N·m].

    Args:
        q: (..., 4) attitudes.
        force_W: (..., 3) in W [N].
    """
    tau = np.cross(np.array(payload.hook), attitude.rotate_back(q, force_W))
    return np.concatenate([force_W, tau], axis=-1)
