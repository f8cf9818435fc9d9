"""Lag of a prediction behind the label where the motion is most aggressive.

A prediction made h steps ago for now is compared with the label. Its lag is the delay s of the
label that the prediction resembles most: the peak over s of the correlation between prediction(t)
and label(t - s), t running over the aggressive samples, channels of a group pooled, each less its
mean. A correlation ignores the amplitude of a cautious forecast. Persistence h steps ahead is the
label h steps late and has a lag of h by construction; 0 is a forecast in time, a negative lag one
that is early.
Source: own choice; cross-correlation with a parabola through its peak, as in time-delay estimation.
"""

import dataclasses as dc

import numpy as np

SHARE = 0.1  # of the samples that count as aggressive: the top decile [1]
REACH = 10  # samples on either side of the slope that gives the jerk; 25 ms at 400 Hz [1]
FLOOR = 0.2  # correlation below which there is no lag to speak of [1]


@dc.dataclass(frozen=True)
class Lag:
    """Lag of a prediction behind its label."""

    steps: float  # NaN where there is none [steps]
    correlation: float  # at that lag [1]


def jerk(s: np.ndarray, w: np.ndarray, step: float) -> np.ndarray:
    """Return |d³p/dt³| (n,) from the specific force and the body rates [m/s³].

    d³p/dt³ = R (ds/dt + w x s), ds/dt the least-squares slope over `REACH` samples on either side.
    It uses future samples: it selects samples for evaluation, and no predictor sees it.

    Args:
        s: (n, 3) specific force in B [m/s²].
        w: (n, 3) body rates in B [rad/s].
        step: sampling time [s].
    Raises: ValueError: if there are fewer than 2 REACH + 1 samples.
    """
    if len(s) < 2 * REACH + 1:
        raise ValueError(f"jerk: at least {2 * REACH + 1} samples are needed; got {len(s)}.")
    lags = np.arange(-REACH, REACH + 1)
    slope = lags / (step * np.sum(lags**2))
    padded = np.pad(s, ((REACH, REACH), (0, 0)), mode="edge")
    rate = np.stack([np.correlate(padded[:, i], slope, mode="valid") for i in range(3)], axis=1)
    return np.linalg.norm(rate + np.cross(w, s), axis=1)


def aggressive(jerk: np.ndarray) -> np.ndarray:
    """Return whether each sample (n,) is in the top `SHARE` of jerk within its flight."""
    return jerk >= np.quantile(jerk, 1.0 - SHARE)


def lag(prediction: np.ndarray, label: np.ndarray, rows: np.ndarray, *, reach: int) -> Lag:
    """Return the lag of a prediction behind its label over the samples `rows`.

    Args:
        prediction: (n, c).
        label: (n, c) at the same instants.
        rows: (m,) sample indices.
        reach: largest shift that is tried, to either side [steps]; rows nearer to an end are left
            out.
    Raises: ValueError: if fewer than three rows are left.
    """
    rows = rows[(rows >= reach) & (rows < len(label) - reach)]
    if len(rows) < 3:
        raise ValueError(
            f"lag: at least 3 samples at {reach} from either end are needed; got {len(rows)}."
        )
    wanted = prediction[rows] - prediction[rows].mean(axis=0)
    size = np.linalg.norm(wanted)
    if not size > 1e-9 * (1.0 + float(np.abs(prediction[rows]).max())):
        return Lag(np.nan, 0.0)  # a constant has no lag
    correlation = np.empty(2 * reach + 1)
    for i, shift in enumerate(range(-reach, reach + 1)):
        shifted = label[rows - shift]
        shifted = shifted - shifted.mean(axis=0)
        correlation[i] = np.sum(wanted * shifted) / (
            size * max(float(np.linalg.norm(shifted)), 1e-300)
        )
    top = int(np.argmax(correlation))
    if correlation[top] < FLOOR or top in (0, 2 * reach):
        return Lag(np.nan, float(correlation[top]))
    before, peak, after = (float(value) for value in correlation[top - 1 : top + 2])
    return Lag(top - reach + 0.5 * (before - after) / (before - 2 * peak + after), float(peak))
