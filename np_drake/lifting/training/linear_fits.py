"""Linear forecasts in closed form, the best for every horizon by itself: ridge on delayed samples,
flights weighted alike.

For zeta held at its last value a lifted linear system answers chi_hat_h = C A^h E w (+ constant):
one linear map W_h of the window a horizon. Fitted freely, horizon by horizon, W_h bounds what any
of them can do; `mode_dictionary`
finds the system closest to it.       Source: own choice; the two steps of subspace identification.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.lifting.model.lifted_linear_system import DelayTaps
from np_drake.lifting.training.excitation import turns
from np_drake.training_data.segments import Segment, group_scale


def sample_scale(segments: Sequence[Segment], wrench: str = "chi") -> np.ndarray:
    """Return scales of a sample [chi, zeta], (12,): one each for force, torque, v and omega [N,
    N·m, m/s, rad/s].
    """
    chi = group_scale([getattr(segment, wrench) for segment in segments], centred=True)
    return np.concatenate([chi, group_scale([segment.zeta for segment in segments], centred=True)])


GROUPS = (slice(0, 3), slice(3, 6))  # force, torque
TURNS = tuple(turns(np.eye(6)))  # (6, 6) each: row vectors chi and zeta times it are their images
NOW = 100.0  # power at horizon 0, where nothing is to be forecast, in units of that one step ahead
CONSTANT = 1e-9  # ridge of the constant feature, whose own power is 1


@dc.dataclass(frozen=True)
class Moments:
    """Second moments of one flight, scaled.

    The last of the p features is the constant 1.
    power: (H, 2) squared error of the better naive row: mean squared change of force and of torque
        over the horizon, or
    their variance where that is less.
    """

    gram: np.ndarray  # (p, p) of the features
    cross: np.ndarray  # (p, H, 6) of features and goals
    square: np.ndarray  # (H, 6) of the goals
    power: np.ndarray


def flight_moments(
    samples: np.ndarray,
    goal: np.ndarray,
    *,
    taps: DelayTaps,
    horizons: np.ndarray,
    max_origins: int,
    symmetry: float,
) -> Moments:
    """Return the moments of a flight over evenly thinned origins.

    Args:
        samples: (n, 12) [chi, zeta], scaled.
        goal: (n, 6), scaled.
        horizons: ascending [steps].
        symmetry: share of the moments that is averaged over quarter turns about body z and the
            mirror y -> -y, 0 … 1. The mean of the images is that of a perfectly symmetric airframe.
    """
    first, last = taps.delay - 1, len(samples) - int(horizons[-1])
    origins = np.arange(first, last, max(1, -(-(last - first) // max_origins)))
    F = np.hstack([taps.features(samples, origins), np.ones((len(origins), 1))])
    Y = goal[origins[:, None] + horizons]
    gram = F.T @ F / len(F)
    cross = (F.T @ Y.reshape(len(F), -1) / len(F)).reshape(-1, len(horizons), 6)
    change = np.mean((Y - samples[origins, None, :6]) ** 2, axis=0)
    power = np.minimum(_grouped(change), _grouped(np.var(Y, axis=0)))
    power[horizons == 0] = NOW * power[horizons > 0].min(axis=0)
    if symmetry > 0:
        gram, cross = symmetrised(
            gram, cross, [_turned(gram, cross, turn) for turn in TURNS], symmetry
        )
    return Moments(gram, cross, np.mean(Y**2, axis=0), np.maximum(power, 1e-12))


def moments_of(segments: Sequence[Segment], scale: np.ndarray, **options) -> list[Moments]:
    """Return the moments of all flights, scaled.

    Args:
        scale: (12,) of [chi, zeta] [N, N·m, m/s, rad/s].
        options: of `flight_moments`.
    """
    samples = [np.hstack([s.chi, s.zeta]) / scale for s in segments]
    return [
        flight_moments(x, s.goal / scale[:6], **options)
        for x, s in zip(samples, segments, strict=True)
    ]


def relative_error(flight: Moments, W: np.ndarray) -> np.ndarray:
    """Return the mean squared error of a forecast over `power`, (H, 2), force and torque [1].

    Args:
        W: (p, H, 6) weights of the features.
    """
    explained = np.einsum("phc,phc->hc", W, 2 * flight.cross)
    explained -= np.einsum("phc,phc->hc", W, np.tensordot(flight.gram, W, axes=1))
    return _grouped(flight.square - explained) / flight.power


def horizon_ridge(flights: Sequence[Moments], *, noise: float) -> np.ndarray:
    """Return the weights W_h of the features, (p, H, 6); the error of each flight counts relative
    to its `power`.

    Args:
        noise: deviation of white noise that the features are taken to have [scaled]. It keeps W_h
            from differencing what another flight's filter or sensor makes differently.
    """
    p, H, _ = flights[0].cross.shape
    W = np.empty((p, H, 6))
    ridge = np.full(p, noise**2)
    ridge[-1] = CONSTANT
    for h in range(H):
        for k, group in enumerate(GROUPS):
            weight = np.array([1.0 / flight.power[h, k] for flight in flights])
            weight /= weight.sum()
            gram = sum(w * flight.gram for w, flight in zip(weight, flights, strict=True))
            cross = sum(
                w * flight.cross[:, h, group] for w, flight in zip(weight, flights, strict=True)
            )
            # Ridge: (sum_f w_f G_f + diag(noise²)) W_h = sum_f w_f X_f'Y_f
            W[:, h, group] = np.linalg.solve(gram + np.diag(ridge), cross)
    return W


def symmetrised(
    gram: np.ndarray,
    cross: np.ndarray,
    images: Sequence[tuple[np.ndarray, np.ndarray]],
    share: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return moments of which a share is averaged over their images.

    Args:
        share: of the average [1].
    """
    grams, crosses = (np.mean(moments, axis=0) for moments in zip(*images, strict=True))
    return (1 - share) * gram + share * grams, (1 - share) * cross + share * crosses


def horizon_grid(longest: int, count: int) -> np.ndarray:
    """Return whole numbers from 0 on, evenly spaced on a logarithmic axis.

    Args:
        longest: the last of them [steps].
        count: how many at most [1].
    """
    return np.unique(np.concatenate([[0], np.round(np.geomspace(1, longest, count - 1))])).astype(
        int
    )


def _grouped(square: np.ndarray) -> np.ndarray:
    """Sum (H, 6) over force and torque to (H, 2)."""
    return np.stack([square[:, group].sum(axis=1) for group in GROUPS], axis=1)


def _turned(gram: np.ndarray, cross: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the moments of the turned flight."""
    taps = (len(gram) - 1) // 12
    T = np.eye(len(gram))
    T[:-1, :-1] = np.kron(np.eye(2 * taps), turn)
    return T.T @ gram @ T, np.einsum("ap,ahc,cd->phd", T, cross, turn, optimize=True)
