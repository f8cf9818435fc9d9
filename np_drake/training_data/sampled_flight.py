"""A flight sampled at a fixed step, as a residual model is fed with it in flight: state, command
and label.
"""

import dataclasses as dc
import functools

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.labels import LabelConfig, labels, raw_labels
from np_drake.residual_model import Sample
from np_drake.rotor_input import acting_command
from np_drake.training_data.accelerations import rows_at, with_accelerations
from np_drake.training_data.segments import Segment
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class SampledFlight:
    """State, command and label of a flight every `step` seconds.

    x: (n, 13) state at t_k = k step, of the last row up to then.
    u: (n, 4) command that acted, mean from t_(k-1) to t_k [N, N·m].
    chi: (n, 6) label, mean of the raw one over the same time [N, N·m]; NaN where the log has a gap.
    """

    step: float
    x: np.ndarray
    u: np.ndarray
    chi: np.ndarray
    name: str = "flight"

    def __len__(self) -> int:
        return len(self.x)

    @property
    def zeta(self) -> np.ndarray:
        """Velocity in W and body rates, (n, 6) [m/s, rad/s]."""
        return self.x[:, 7:13]

    @functools.cached_property
    def gapless(self) -> bool:
        """Whether every sample has a label."""
        return bool(np.isfinite(self.chi).all())

    @property
    def segment(self) -> Segment:
        """Whole flight as training input and target, gaps of the label bridged by a line."""
        k, good = np.arange(len(self)), np.isfinite(self.chi).all(axis=1)
        chi = np.stack([np.interp(k, k[good], column[good]) for column in self.chi.T], axis=1)
        return Segment(chi, self.zeta, self.step)

    def rows(self, start: int, stop: int) -> "SampledFlight":
        """Return samples `start` to `stop`, without the last."""
        part = slice(start, stop)
        return dc.replace(self, x=self.x[part], u=self.u[part], chi=self.chi[part])

    def sample(self, k: int) -> Sample:
        """Return sample k."""
        return Sample(self.x[k], self.u[k], self.chi[k])


def sampled_flight(
    log: FlightLog, vehicle: Vehicle, *, step: float = 0.02, label: LabelConfig | None = None
) -> SampledFlight:
    """Return the flight with labels of eq. (1) averaged over each step, which uses nothing later
    than the sample.

    Accelerations that the log lacks are differentiated first, see `with_accelerations`.

    Args:
        step: time between samples [s].
    Raises: ValueError: if the step is shorter than the log's, or the flight than two steps.
    """
    if not step > 0.999 * log.step:
        raise ValueError(
            f"sampled_flight: step must be at least that of {log.name}, {log.step:.4g} s; "
            f"got {step:.4g} s."
        )
    log = with_accelerations(log)
    t = log.t - log.t[0]
    count = int(t[-1] / step + 1e-6) + 1
    if count < 3:
        raise ValueError(
            f"sampled_flight: {log.name} must last two steps of {step:g} s; got {t[-1]:.3g} s."
        )
    bins = np.ceil(t / step - 1e-6).astype(
        int
    )  # row of time t belongs to the sample that ends its step
    last = np.searchsorted(t, step * np.arange(count) + 1e-6 * step, side="right") - 1
    raw = raw_labels(log, vehicle)
    chi = _means(raw, bins, count)
    u = _held(_means(acting_command(log, vehicle), bins, count))
    if label is not None:
        chi = np.where(np.isfinite(chi), labels(log, vehicle, label)[last], np.nan)
    return SampledFlight(step, log.x[last], u, chi, log.name)


def picked_flight(
    log: FlightLog, vehicle: Vehicle, *, step: float, label: LabelConfig | None = None
) -> SampledFlight:
    """Return the flight with the rows nearest to every step, as a predictor sees them in flight
    (see `rows_at`).

    The label of a row is that of the command that acts at the row, its `u` the mean command since
    the row before.

    Args:
        step: time between samples [s].
        label: low-pass; None: that of the vehicle.
    Raises: ValueError: if the step does not fit the log.
    """
    chi, rows = labels(log, vehicle, label), rows_at(log, step)
    before = np.concatenate([[max(rows[0] - 1, 0)], rows[:-1]])
    u = np.array(
        [
            log.u[start : max(row, start + 1)].mean(axis=0)
            for start, row in zip(before, rows, strict=True)
        ]
    )
    return SampledFlight(step, log.x[rows], u, chi[rows], log.name)


def of_wrenches(chi: np.ndarray, zeta: np.ndarray, step: float) -> SampledFlight:
    """Return a flight of which labels and motion zeta (n, 6) are known alone: level, without a
    command.

    Args:
        chi: (n, 6) labels [N, N·m].
        zeta: (n, 6) velocity and body rates [m/s, rad/s].
        step: time between samples [s].
    """
    x = np.zeros((len(chi), 13))
    x[:, 3], x[:, 7:] = 1.0, zeta
    return SampledFlight(step, x, np.zeros((len(chi), 4)), chi)


def _means(values: np.ndarray, bins: np.ndarray, count: int) -> np.ndarray:
    """Return the mean of the finite rows of each bin, (count, c); NaN where it has none."""
    good = np.isfinite(values).all(axis=1) & (bins < count)
    size = np.bincount(bins[good], minlength=count).astype(float)
    size[size == 0] = np.nan
    return np.stack(
        [np.bincount(bins[good], column[good], count) / size for column in values.T], axis=1
    )


def _held(values: np.ndarray) -> np.ndarray:
    """Return rows (n, c) with those of NaN replaced by the last finite one, or the first at the
    beginning.
    """
    good = np.isfinite(values).all(axis=1)
    source = np.maximum.accumulate(np.where(good, np.arange(len(values)), 0))
    source[source == 0] = int(np.argmax(good)) if not good[0] else 0
    return values[source]
