"""Localisation of the gap in channel, time, regime and frequency, and what the logs can tell."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import ruptures
from scipy import signal

from np_drake import attitude
from np_drake.diagnosis.held_out import closed_fraction, pooled
from np_drake.diagnosis.numerics import NoiseModel, fit_noise
from np_drake.diagnosis.regressors import Candidate, hidden_from, library_candidates
from np_drake.diagnosis.residuals import QUIET, WRENCH, FlightResiduals
from np_drake.diagnosis.result import (
    CHANNELS,
    Band,
    ChannelGap,
    Confusable,
    GapReduction,
    Identifiability,
    Localisation,
    Regime,
    Segment,
)
from np_drake.effects.library import REQUIREMENTS, effect_of

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


# Of any quantity, to tell effects apart [m/s, rad/s, deg, 1]; own choice.
LEAST_EXCITATION = {"speed": 0.08, "rate": 0.05, "tilt": 1.0, "thrust variation": 0.01}
BARELY_VISIBLE = 10.0  # whitened size of an effect that is just visible [1]
SAME_DISTANCE = (
    9.0  # squared whitened distance below which two just visible effects are the same [1]
)


def excitation(flights: Sequence[FlightResiduals]) -> dict[str, float]:
    """Return RMS values and spans over all flights by quantity, with the unit in the key; 0 of what
    was not logged.
    """
    v = np.concatenate([e.mids.x[:, 7:10] * ("velocity" not in e.log.lacks) for e in flights])
    w = np.concatenate([e.w for e in flights])
    tilt = np.degrees(
        np.concatenate(
            [np.arccos(np.clip(attitude.body_z(e.mids.q)[:, 2], -1, 1)) for e in flights]
        )
    )
    f = np.concatenate([e.nominal[:, 2] for e in flights])
    tau = np.concatenate([e.nominal[:, 3:] for e in flights])
    z = np.concatenate([e.mids.x[:, 2] * ("height" not in e.log.lacks) for e in flights])

    def rms(a: np.ndarray) -> float:
        return float(np.sqrt(np.mean(np.sum(np.atleast_2d(a.T).T ** 2, axis=1))))

    return {
        "speed [m/s]": rms(v),
        "rate [rad/s]": rms(w),
        "tilt [deg]": rms(tilt),
        "thrust variation [1]": float(f.std() / max(abs(f.mean()), 1e-9)),
        "torque [N·m]": rms(tau),
        "height span [m]": float(np.ptp(z)),
        "duration [s]": float(sum(e.t[-1] - e.t[0] for e in flights)),
    }


def excited(excitations: dict[str, float]) -> bool:
    """Return whether any quantity of `excitation` is large enough to tell effects apart."""
    named = {key.split(" [")[0]: value for key, value in excitations.items()}
    return any(named[key] >= least for key, least in LEAST_EXCITATION.items())


def _confusables(
    flights: Sequence[FlightResiduals], candidates: Sequence[Candidate], noise: NoiseModel
) -> list[Confusable]:
    """Return the effects that cannot be seen at their usual size, and pairs that are the same when
    just visible.

    An effect scaled to whitened size `BARELY_VISIBLE` is the same as another if its squared
    distance to the other's columns is below `SAME_DISTANCE`; effects of one sign alone, as a delay
    and an early clock, where signs agree.
    """
    blocks: dict[str, np.ndarray] = {}
    one_sided: set[str] = set()
    for c in candidates:
        name = c.identifiers[-1]
        if name in blocks or len(c.identifiers) > 1 or c.generic:
            continue
        blocks[name] = np.concatenate(
            [noise.whiten(c.columns[e.name]).reshape(-1, c.size) for e in flights]
        )
        if c.size == 1 and c.possible is not None:
            one_sided.add(name)
    sizes = {n: float(np.sqrt(np.max(np.sum(X**2, axis=0)))) for n, X in blocks.items()}
    no_trace = "at its usual size it leaves no trace in these flights"
    out = [Confusable((n,), no_trace, manoeuvre((n,))) for n, s in sizes.items() if s < 3.0]
    visible = {n: X for n, X in blocks.items() if sizes[n] >= 3.0}
    bases = {n: np.linalg.qr(X[:, np.linalg.norm(X, axis=0) > 1e-9])[0] for n, X in visible.items()}
    found: set[tuple[str, str]] = set()
    for a, X in visible.items():
        direction = X[:, np.argmax(np.sum(X**2, axis=0))]
        direction = BARELY_VISIBLE * direction / np.linalg.norm(direction)
        for b, Q in bases.items():
            # No positive size of one is what a positive size of the other is.
            if {a, b} <= one_sided and float(direction @ blocks[b][:, 0]) < 0:
                continue
            if a != b and float(np.sum((direction - Q @ (Q.T @ direction)) ** 2)) < SAME_DISTANCE:
                found.add((a, b) if a < b else (b, a))
    out += [
        Confusable(pair, "their traces in these flights are collinear", manoeuvre(pair))
        for pair in sorted(found)
    ]
    return out


def assess_identifiability(
    train: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    candidates: Sequence[Candidate],
    noise: NoiseModel,
) -> Identifiability:
    """Return excitation, noise floor, unidentifiable effects and warnings of the logs."""
    warnings = [f"{e.name}: {note}" for e in [*train, *held_out] for note in e.log.notes]
    if train[0].log.input == "rotor_speed":
        warnings.append(
            "rotor speed is the input: motor_lag, command_delay and clock_offset cannot be told."
        )
    hidden = hidden_from(train)
    for quantity in sorted({quantity for e in train for quantity in e.log.lacks}):
        names = ", ".join(
            name for name, reason in hidden.items() if reason == REQUIREMENTS[quantity]
        )
        warnings += [f"{REQUIREMENTS[quantity]}: {names} cannot be told."] * bool(names)
    for e in [*train, *held_out]:
        if e.log.a is None:
            said = "no acceleration; velocity is differentiated, accelerometer_bias cannot be told."
            warnings.append(f"{e.name}: {said}")
        if e.attitude_noise > QUIET:
            how = "turned with it" if e.turned else "free of it"
            warnings.append(
                f"{e.name}: attitude noise of {1e3 * e.attitude_noise:.1f} mrad; "
                f"acceleration is {how}."
            )
    return Identifiability(
        usable=True,
        excitation=excitation(train),
        noise_floor={name: float(noise.rms[WRENCH][c]) for c, name in enumerate(CHANNELS)},
        not_identifiable=tuple(_confusables(train, candidates, noise)),
        warnings=tuple(warnings),
    )


def manoeuvre(effects: Sequence[str]) -> str:
    """Return one line that names a manoeuvre for one effect or for a pair, by their identifiers."""
    if len(effects) == 2 and (apart := tells_apart(*effects)):
        return apart
    known = [effect_of(name).excited_by for name in effects if effect_of(name).excited_by]
    return (
        "; or ".join(dict.fromkeys(known)) or "a flight that excites every axis at several speeds"
    )


def tells_apart(a: str, b: str) -> str:
    """Return the manoeuvre of their own that tells effects a and b apart; empty where none is
    known.
    """
    return effect_of(a).told_from.get(b, "") or effect_of(b).told_from.get(a, "")


def unexcited_diagnosis(
    flights: Sequence[FlightResiduals], held_out: Sequence[FlightResiduals]
) -> dict[str, Any]:
    """Return the fields of a `Diagnosis` for flights in which nothing moves: an empty verdict,
    nothing identifiable.
    """
    noise = fit_noise([e.y for e in flights], flights[0].grid.step)
    pairs = _confusables(flights, library_candidates(flights), noise)
    rows = {e.name: np.ones(len(e.t), bool) for e in held_out}
    checked = Identifiability(
        False,
        excitation(flights),
        {},
        tuple(pairs),
        ("nothing is excited: these logs cannot tell.",),
    )
    size = pooled([e.y for e in held_out], noise)
    return {
        "verdict": (),
        "causes": (),
        "identifiability": checked,
        "localisation": localise(held_out, {e.name: e.y for e in held_out}, noise, rows),
        "gap_reduction": GapReduction(size, size, 1.0, 0.0, (0.0, 0.0), ()),
        "warnings": checked.warnings,
    }
