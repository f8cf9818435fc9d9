"""Path of a payload under a moving hook, for many start states at once."""

import numpy as np

DAMPING = 0.1  # of the swing by the air; measured on payloads of five grams, 0.09 to 0.17 [1/s]
SUBSTEP = 0.004  # [s]


def substeps(step: float) -> int:
    """Return how many equal steps of at most `SUBSTEP` a step takes [1]."""
    return max(1, int(np.ceil(step / SUBSTEP - 1e-9)))


def advance(
    r: np.ndarray,
    r_rate: np.ndarray,
    a_hook: np.ndarray,
    step: float,
    *,
    length: float | np.ndarray,
    gravity: float,
    damping: float = DAMPING,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return p_ToPo_W, its rate and the mean pull on the hook per mass after one step, (m, 3) each [m, m/s, m/s²].

    A point mass on a tether that cannot push, under a hook with acceleration a_hook (3,) or (m, 3) in W [m/s²], held
    over the step [s]; length: of all or of each, (m,) [m]; damping [1/s] acts on the rate.
    Source: velocity Verlet with the constraint |r| <= length in positions and rates (RATTLE, Andersen 1983).
    """
    count = substeps(step)
    h = step / count
    pull = np.zeros_like(r)
    reach = np.broadcast_to(np.square(length), r.shape[:1])
    kick = -(a_hook + np.array([0.0, 0.0, gravity]))
    for _ in range(count):
        free = r + h * (1 - 0.5 * h * damping) * r_rate + 0.5 * h**2 * kick
        along, square = np.sum(r * free, axis=-1), np.sum(r * r, axis=-1)
        excess = np.sum(free * free, axis=-1) - reach
        root = np.sqrt(np.maximum(along**2 - square * excess, 0.0))
        mu = np.where(excess > 0, excess / np.maximum(along + root, 1e-12), 0.0)[:, None]
        now = free - mu * r
        rate = (r_rate + 0.5 * h * (kick - damping * r_rate)) - mu * r / h
        rate = rate + 0.5 * h * (kick - damping * rate)
        taut = (mu > 0) | (np.sum(now * now, axis=-1) >= reach * (1 - 1e-9))[:, None]
        outward = np.maximum(np.sum(now * rate, axis=-1, keepdims=True), 0.0) / reach[:, None]
        half = np.where(taut, outward, 0.0)
        pull += mu * r / h**2 + half * now / h
        r, r_rate = now, rate - half * now
    return r, r_rate, pull / count


def path(
    r: np.ndarray,
    r_rate: np.ndarray,
    a_hook: np.ndarray,
    step: float,
    *,
    length: float | np.ndarray,
    gravity: float,
    damping: float = DAMPING,
) -> tuple[np.ndarray, np.ndarray]:
    """Return p_ToPo_W at n + 1 instants and the mean pull per mass over the n steps, (n + 1, m, 3) and (n, m, 3).

    Args: r, r_rate: (m, 3) at the start [m, m/s].   a_hook: (n, 3), held over each step [m/s²].   step: [s].
    """
    at, pulls = [r], []
    for a in a_hook:
        r, r_rate, pull = advance(r, r_rate, a, step, length=length, gravity=gravity, damping=damping)
        at.append(r)
        pulls.append(pull)
    return np.stack(at), np.stack(pulls)


def hanging(
    offset: np.ndarray, rate: np.ndarray, length: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return p_ToPo_W and its rate (m, 3) of taut tethers, from offset and rate to the side (m, 2) [m, m/s]."""
    length = np.broadcast_to(length, offset.shape[:1])[:, None]
    far = np.linalg.norm(offset, axis=-1, keepdims=True)
    offset = offset * np.minimum(1.0, 0.99 * length / np.maximum(far, 1e-12))
    down = -np.sqrt(length**2 - np.sum(offset**2, axis=-1, keepdims=True))
    sinking = -np.sum(offset * rate, axis=-1, keepdims=True) / down
    return np.concatenate([offset, down], axis=-1), np.concatenate([rate, sinking], axis=-1)
