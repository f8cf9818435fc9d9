"""Localisation of the gap in channel, time, flight regime and frequency."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import ruptures
from scipy import signal

from np_drake import attitude
from np_drake.diagnosis.held_out import closed_fraction
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.residuals import WRENCH, FlightResiduals
from np_drake.diagnosis.residuals.residual_parts import (
    CHANNELS,
    Band,
    ChannelGap,
    Localisation,
    Regime,
    Segment,
)

UNITS = ("N", "N", "N", "N·m", "N·m", "N·m")
BINS = 4  # about as many regimes of each quantity
# share of the rows at either end that widens the outer regimes, and makes none of its own [1]
RARE = 0.02
COARSE = 0.2  # time resolution of change points [s]
PENALTY = 35.0  # penalty of a change point, in noise variance times channels; own choice
LEAST_SPAN = 1e-3  # span of a quantity below which it has no regimes [its unit]


def localise(
    flights: Sequence[FlightResiduals],
    after: dict[str, np.ndarray],
    noise: NoiseModel,
    rows: dict[str, np.ndarray],
) -> Localisation:
    """Localise the gap of flights, before and after the causes are added.

    Args:
        after: by flight, (m, 15) residual after the causes.
        rows: by flight, (m,) bool, the rows that count.
    """
    before = {e.name: e.against_file[:, WRENCH] for e in flights}
    residual = {e.name: after[e.name][:, WRENCH] for e in flights}
    return Localisation(
        channels=_channel_gaps(before, residual, noise, rows),
        segments=tuple(s for e in flights for s in _segments(e, noise)),
        regimes=_regimes(flights, residual, noise),
        bands=_bands(flights, residual, noise),
        times={e.name: e.t for e in flights},
        before=before,
        after=residual,
    )


def _channel_gaps(
    before: dict[str, np.ndarray],
    after: dict[str, np.ndarray],
    noise: NoiseModel,
    rows: dict[str, np.ndarray],
) -> tuple[ChannelGap, ...]:
    """Return the RMS residual (m, 6) by flight before and after, by channel, pooled over the rows
    that count.
    """

    def rms(parts: dict[str, np.ndarray], c: int) -> float:
        return float(np.sqrt(np.mean(np.concatenate([parts[n][rows[n], c] for n in parts]) ** 2)))

    out = []
    for c, name in enumerate(CHANNELS):
        b, a, floor = rms(before, c), rms(after, c), float(noise.rms[c])
        out.append(ChannelGap(name, UNITS[c], b, floor, a, closed_fraction(b, a, floor)))
    return tuple(out)


def _segments(flight: FlightResiduals, noise: NoiseModel) -> list[Segment]:
    """Return the segments of a flight between change points of the residual's mean.

    Source: exact segmentation by dynamic programming, PELT (Killick et al. 2012); the penalty is
    own choice.
    """
    scaled = flight.against_file[:, WRENCH] / np.maximum(noise.rms[WRENCH], 1e-12)
    bin_ = max(1, round(COARSE / flight.grid.step))
    n = len(scaled) // bin_
    coarse = scaled[: n * bin_].reshape(n, bin_, 6).mean(axis=1)
    spread = np.maximum(coarse.std(axis=0), 1e-9)
    ends = ruptures.Pelt(model="l2", min_size=5, jump=1).fit(coarse / spread).predict(pen=PENALTY)
    out = []
    for a, b in pairwise([0, *ends]):
        part = scaled[a * bin_ : b * bin_]
        start, end = flight.t[a * bin_], flight.t[min(b * bin_, len(flight.t) - 1)]
        out.append(
            Segment(
                flight.name,
                float(start),
                float(end),
                tuple(np.sqrt(np.mean(part**2, axis=0)).tolist()),
            )
        )
    return out


def quantities(flight: FlightResiduals) -> dict[str, tuple[np.ndarray, str]]:
    """Return the quantities that define a regime: by name, values (m,) on the grid and unit; zero
    where not logged.
    """
    mids = flight.mids
    tilt = np.degrees(np.arccos(np.clip(attitude.body_z(mids.q)[:, 2], -1, 1)))
    at_mids = np.stack(
        [
            np.linalg.norm(mids.x[:, 7:10], axis=1),
            mids.x[:, 2],
            tilt,
            np.linalg.norm(mids.x[:, 10:13], axis=1),
        ],
        axis=1,
    )
    told = [name not in flight.log.lacks for name in ("velocity", "height", "attitude")] + [True]
    on = flight.from_mids(at_mids) * told
    return {
        "speed": (on[:, 0], "m/s"),
        "thrust": (flight.nominal[:, 2], "N"),
        "height": (on[:, 1], "m"),
        "tilt": (on[:, 2], "deg"),
        "rate": (on[:, 3], "rad/s"),
    }


def _regimes(
    flights: Sequence[FlightResiduals], after: dict[str, np.ndarray], noise: NoiseModel
) -> tuple[Regime, ...]:
    """Return the RMS residual before and after, (m, 6) by flight, in ranges of each quantity with
    round bounds.
    """
    all_of = [quantities(e) for e in flights]
    before = np.concatenate([e.against_file[:, WRENCH] for e in flights]) / np.maximum(
        noise.rms[WRENCH], 1e-12
    )
    residual = np.concatenate([after[e.name] for e in flights]) / np.maximum(
        noise.rms[WRENCH], 1e-12
    )
    out = []
    for name in all_of[0]:
        value = np.concatenate([q[name][0] for q in all_of])
        if np.ptp(value) < LEAST_SPAN:
            continue
        edges = _round_bounds(value)
        for i in range(len(edges) - 1):
            inside = (value >= edges[i]) & ((value < edges[i + 1]) | (i == len(edges) - 2))
            if not inside.any():
                continue
            rms = [
                tuple(np.sqrt(np.mean(part[inside] ** 2, axis=0)).tolist())
                for part in (before, residual)
            ]
            unit = all_of[0][name][1]
            out.append(
                Regime(name, unit, float(edges[i]), float(edges[i + 1]), int(inside.sum()), *rms)
            )
    return tuple(out)


def _round_bounds(value: np.ndarray) -> np.ndarray:
    """Return increasing multiples of 1, 2 or 5 times a power of ten that hold all values, some
    `BINS` ranges.
    """
    low, high = np.quantile(value, (RARE, 1 - RARE))
    width = max(high - low, LEAST_SPAN) / BINS
    power = 10.0 ** np.floor(np.log10(width))
    step = power * min((1.0, 2.0, 5.0, 10.0), key=lambda digit: abs(np.log(digit * power / width)))
    inner = np.arange(np.floor(low / step) + 1, np.ceil(high / step))
    outer = (
        np.floor(value.min() / step),
        max(np.ceil(value.max() / step), np.floor(value.min() / step) + 1),
    )
    return step * np.unique([outer[0], *inner, outer[1]])


def _bands(
    flights: Sequence[FlightResiduals], after: dict[str, np.ndarray], noise: NoiseModel
) -> tuple[Band, ...]:
    """Return Welch spectra by channel before and after, averaged over flights, with those of the
    noise model.
    """
    rate = 1.0 / flights[0].grid.step
    length = min(256, *(len(e.t) for e in flights))

    def spectrum(parts: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        found = [signal.welch(p, rate, nperseg=length, axis=0, detrend=False) for p in parts]
        return found[0][0], np.mean([s for _, s in found], axis=0)

    frequency, b = spectrum([e.against_file[:, WRENCH] for e in flights])
    _, a = spectrum([after[e.name] for e in flights])
    model = noise.spectrum(frequency)
    return tuple(
        Band(name, frequency, b[:, c], a[:, c], model[c]) for c, name in enumerate(CHANNELS)
    )
