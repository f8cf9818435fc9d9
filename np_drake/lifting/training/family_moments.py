"""Second moments of flights, all that the multi-step loss of a lifted linear system needs of them.

A forecast h steps ahead is linear in the window and in the coming inputs, f_(k+h) = G_h [w_k, u_k …
u_(k+h-1)]. The mean square of its error over a flight is therefore a function of the flight's
second moments alone: exact, and as cheap for an hour of flight as for a minute.
"""

import dataclasses as dc

import numpy as np

MOST_WINDOWS = 40_000  # over which the principal components are taken [1]


@dc.dataclass(frozen=True)
class WindowMoments:
    """Moments of F flights along one axis, its views pooled.

    whitening: (n, D c) map of a window to its principal components, of unit variance over all
        flights.
    gram: (F, p, p) of [white window (n), coming inputs (H (c - 1))], the variance of white noise in
        them added.
    cross: (F, p, h) with the force at the horizons.
    square: (F, h) of the force.
    power: (F, h) mean square of the error of persistence, the variance of the noise added.
    """

    whitening: np.ndarray
    gram: np.ndarray
    cross: np.ndarray
    square: np.ndarray
    power: np.ndarray


def window_moments(
    seen: list[np.ndarray],
    goals: list[np.ndarray],
    *,
    delay: int,
    horizons: np.ndarray,
    noise: tuple[float, float],
) -> WindowMoments:
    """Return the moments of flights.

    Args:
        seen: of each flight, (V, n, c) samples as the views see them, the force first [scaled].
        goals: of each flight, (V, n) the force that is to be foreseen [scaled].
        horizons: (h,) ascending [steps].
        noise: deviation of white noise that the window and the coming inputs are taken to have
            [scaled].
    """
    H, total = int(horizons[-1]), sum(s.shape[0] * s.shape[1] for s in seen)
    stride = max(1, total // MOST_WINDOWS)
    some = np.concatenate(
        [_windows(s, delay)[:, ::stride].reshape(-1, delay * s.shape[2]) for s in seen]
    )
    power, directions = np.linalg.eigh(some.T @ some / len(some))
    told = power > noise[0] ** 2
    scale = 1.0 / np.sqrt(power[told] + noise[0] ** 2)
    whitening = scale[:, None] * directions[:, told].T
    coming = seen[0].shape[2] - 1
    variance = np.concatenate([(noise[0] * scale) ** 2, np.full(H * coming, noise[1] ** 2)])
    rows: list[tuple] = []
    for s, goal in zip(seen, goals, strict=True):
        now = np.arange(delay - 1, s.shape[1] - H)
        w = _windows(s, delay)[:, : len(now)].reshape(s.shape[0], len(now), -1) @ whitening.T
        u = s[:, now[:, None] + np.arange(H), 1:].reshape(s.shape[0], len(now), -1)
        X = np.concatenate([w, u], axis=2).reshape(-1, len(variance))
        Y = goal[:, now[:, None] + horizons].reshape(-1, len(horizons))
        still = np.mean((Y - s[:, now, 0].reshape(-1, 1)) ** 2, axis=0) + noise[0] ** 2
        rows.append(
            (X.T @ X / len(X) + np.diag(variance), X.T @ Y / len(X), np.mean(Y**2, axis=0), still)
        )
    return WindowMoments(whitening, *(np.stack(part) for part in zip(*rows, strict=True)))


def _windows(seen: np.ndarray, delay: int) -> np.ndarray:
    """Return every window of (V, n, c), oldest sample first, (V, n - D + 1, D, c)."""
    return np.lib.stride_tricks.sliding_window_view(seen, delay, axis=1).swapaxes(2, 3)
