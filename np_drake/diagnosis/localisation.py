"""Localisation of the gap, and what the logs excite and can tell apart."""

from collections.abc import Sequence

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.held_out import pooled
from np_drake.diagnosis.numerics import NoiseModel, fit_noise
from np_drake.diagnosis.regressors import hidden_from
from np_drake.diagnosis.residuals import QUIET, WRENCH, FlightResiduals
from np_drake.diagnosis.result import (
    CHANNELS,
    ChannelGap,
    Diagnosis,
    GapReduction,
    Identifiability,
    Localisation,
    Regime,
)
from np_drake.effects.library import REQUIREMENTS, effect_of
from np_drake.rigid_body import V, W

UNITS = ("N", "N", "N", "N·m", "N·m", "N·m")
BINS = 4  # about as many regimes of each quantity
# Share of the rows at either end that widens the outer regimes, and makes none of its own [1].
RARE = 0.02
LEAST_SPAN = 1e-3  # span of a quantity below which it has no regimes [its unit]

CANNOT_TELL = "These logs cannot tell"


def localise(
    flights: Sequence[FlightResiduals],
    after: dict[str, np.ndarray],
    noise: NoiseModel,
    rows: dict[str, np.ndarray],
) -> Localisation:
    """Localise the gap of flights, before and after the causes are added.

    after: by flight, (m, 15) residual after the causes. rows: (m,) bool, those that count.
    """
    before = {e.name: e.against_file[:, WRENCH] for e in flights}
    residual = {e.name: after[e.name][:, WRENCH] for e in flights}
    was, now = (
        np.sqrt(np.mean(np.concatenate([of[n][rows[n]] for n in of]) ** 2, axis=0))
        for of in (before, residual)
    )
    channels = zip(CHANNELS, UNITS, was.tolist(), noise.rms.tolist(), now.tolist(), strict=False)
    return Localisation(
        channels=tuple(ChannelGap(*channel) for channel in channels),
        regimes=_regimes(flights, residual, noise),
        times={e.name: e.t for e in flights},
        before=before,
        after=residual,
    )


def quantities(flight: FlightResiduals) -> dict[str, np.ndarray]:
    """Return what defines a regime: by name and unit, (m,) on the grid; zero where not logged."""
    mids = flight.mids
    tilt = np.degrees(np.arccos(np.clip(attitude.body_z(mids.q)[:, 2], -1, 1)))
    speed, rate = (np.linalg.norm(mids.x[:, part], axis=1) for part in (V, W))
    told = [name not in flight.log.lacks for name in ("velocity", "height", "attitude")] + [True]
    on = flight.from_mids(np.stack([speed, mids.x[:, 2], tilt, rate], axis=1)) * told
    return {
        "speed [m/s]": on[:, 0],
        "thrust [N]": flight.nominal[:, 2],
        "height [m]": on[:, 1],
        "tilt [deg]": on[:, 2],
        "rate [rad/s]": on[:, 3],
    }


def _regimes(
    flights: Sequence[FlightResiduals], after: dict[str, np.ndarray], noise: NoiseModel
) -> tuple[Regime, ...]:
    """Return the RMS residual before and after, (m, 6) by flight, in ranges of each quantity."""
    all_of = [quantities(e) for e in flights]
    scale = np.maximum(noise.rms[WRENCH], 1e-12)
    before = np.concatenate([e.against_file[:, WRENCH] for e in flights]) / scale
    residual = np.concatenate([after[e.name] for e in flights]) / scale
    out = []
    for key in all_of[0]:
        value = np.concatenate([q[key] for q in all_of])
        if np.ptp(value) < LEAST_SPAN:
            continue
        edges = _round_bounds(value)
        bins = np.clip(np.digitize(value, edges) - 1, 0, len(edges) - 2)
        name, _, unit = key.removesuffix("]").partition(" [")
        for i in np.unique(bins):
            some, bounds = bins == i, (float(edges[i]), float(edges[i + 1]))
            rms = [
                np.sqrt(np.mean(part[some] ** 2, axis=0)).tolist() for part in (before, residual)
            ]
            out.append(Regime(name, unit, *bounds, int(some.sum()), *map(tuple, rms)))
    return tuple(out)


def _round_bounds(value: np.ndarray) -> np.ndarray:
    """Return multiples of 1, 2 or 5 times a power of ten that hold all values in `BINS` ranges."""
    low, high = np.quantile(value, (RARE, 1 - RARE))
    width = max(high - low, LEAST_SPAN) / BINS
    power = 10.0 ** np.floor(np.log10(width))
    step = power * min((1.0, 2.0, 5.0, 10.0), key=lambda digit: abs(np.log(digit * power / width)))
    inner = np.arange(np.floor(low / step) + 1, np.ceil(high / step))
    first = np.floor(value.min() / step)
    return step * np.unique([first, *inner, max(np.ceil(value.max() / step), first + 1)])


LITTLE = 0.5  # share of torque that the motion shows, below which it is said [1]; own choice
# Of any quantity, to tell effects apart; own choice.
LEAST_EXCITATION = {
    "speed [m/s]": 0.08,
    "rate [rad/s]": 0.05,
    "tilt [deg]": 1.0,
    "thrust variation [1]": 0.01,
}


def excitation(flights: Sequence[FlightResiduals]) -> dict[str, float]:
    """Return RMS values and spans over all flights by quantity, with the unit in the key; 0 of what
    was not logged.
    """
    x = np.concatenate([e.mids.x for e in flights])
    told = {
        name: np.concatenate([np.full(len(e.mids.t), name not in e.log.lacks) for e in flights])
        for name in ("velocity", "height")
    }
    w = np.concatenate([e.w for e in flights])
    up = np.clip(attitude.body_z(np.concatenate([e.mids.q for e in flights]))[:, 2], -1, 1)
    u = np.concatenate([e.nominal[:, 2:] for e in flights])
    f = u[:, 0]

    def rms(a: np.ndarray) -> float:
        return float(np.sqrt(np.mean(np.sum(a**2, axis=1))))

    return {
        "speed [m/s]": rms(x[:, 7:10] * told["velocity"][:, None]),
        "rate [rad/s]": rms(w),
        "tilt [deg]": rms(np.degrees(np.arccos(up))[:, None]),
        "thrust variation [1]": float(f.std() / max(abs(f.mean()), 1e-9)),
        "torque [N·m]": rms(u[:, 1:]),
        "height span [m]": float(np.ptp(x[:, 2] * told["height"])),
        "duration [s]": float(sum(e.t[-1] - e.t[0] for e in flights)),
    }


def excited(excitations: dict[str, float]) -> bool:
    """Return whether any quantity of `excitation` is large enough to tell effects apart."""
    return any(excitations[key] >= least for key, least in LEAST_EXCITATION.items())


def assess_identifiability(
    train: Sequence[FlightResiduals], held_out: Sequence[FlightResiduals], noise: NoiseModel
) -> Identifiability:
    """Return excitation, noise floor and warnings of the logs."""
    warnings = [f"{e.name}: {note}" for e in [*train, *held_out] for note in e.log.notes]
    if train[0].log.input == "rotor_speed":
        warnings.append(
            "rotor speed is the input: motor_lag, command_delay and clock_offset cannot be told."
        )
    if min(train[0].torque_gain) < LITTLE:
        warnings.append(
            "of the logged torque about x, y, z the motion shows "
            + ", ".join(f"{100 * share:.0f} %" for share in train[0].torque_gain)
            + ": commands change faster than the rows of the log, or moments of inertia are larger "
            "than in the file."
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
        warnings=tuple(warnings),
    )


def manoeuvre(effects: Sequence[str]) -> str:
    """Return one line that names a manoeuvre for one effect or for a pair, by their identifiers."""
    if len(effects) == 2 and (apart := tells_apart(*effects)):
        return apart
    known = dict.fromkeys(effect_of(name).excited_by for name in effects)
    every = "a flight that excites every axis at several speeds"
    return "; or ".join(filter(None, known)) or every


def tells_apart(a: str, b: str) -> str:
    """Return the manoeuvre of their own that tells effects a and b apart; empty where none is
    known.
    """
    return effect_of(a).told_from.get(b, "") or effect_of(b).told_from.get(a, "")


def unexcited_diagnosis(
    flights: Sequence[FlightResiduals], held_out: Sequence[FlightResiduals]
) -> Diagnosis:
    """Return the diagnosis of flights in which nothing moves: an empty verdict."""
    noise = fit_noise([e.y for e in flights], flights[0].grid.step)
    rows = {e.name: np.ones(len(e.t), bool) for e in held_out}
    warnings = ("nothing is excited: these logs cannot tell.",)
    size = pooled([e.y for e in held_out], noise)
    return Diagnosis(
        vehicle=flights[0].vehicle.name,
        nominal=flights[0].vehicle,
        train=tuple(e.name for e in flights),
        held_out=tuple(e.name for e in held_out),
        verdict=(),
        causes=(),
        identifiability=Identifiability(False, excitation(flights), {}, warnings),
        localisation=localise(held_out, {e.name: e.y for e in held_out}, noise, rows),
        gap_reduction=GapReduction(size, size),
        warnings=warnings,
        cannot_tell=True,
        headline=CANNOT_TELL,
    )
