"""What a flight log shows by itself: its facts, and what stands against any answer from it.

Laws that fail and a large share of the weight are said first by `np-drake doctor`, and by a
diagnosis before its answer.
"""

import dataclasses as dc
from collections.abc import Sequence
from typing import Any

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.residuals import FORCE, FlightResiduals
from np_drake.estimation.noise import white_noise
from np_drake.files.number_text import percent
from np_drake.finding import Finding, Kind, Place, shown_at
from np_drake.flight_log import FlightLog
from np_drake.logs.clock import FINEST, Lag, lag_of, state_lags
from np_drake.logs.columns import LOOKS, UNLOGGED
from np_drake.logs.importing.laws import (
    OPPOSED,
    failing,
    misfit_text,
    misfits,
    never_tilts,
    told_by_noise,
)
from np_drake.logs.importing.log_map import GRAVITY
from np_drake.logs.importing.parts import lift_of
from np_drake.logs.importing.signals import Signal
from np_drake.logs.rotors import torque_agreement
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle


@dc.dataclass(frozen=True)
class SignalFacts:
    """White noise of one signal of a log, and what is usual.

    white: standard deviation of its white noise, from second differences; the largest of its
    columns, in `unit`.
    usual: that of the vehicle file or of usual sensors; 0: none is known.
    """

    name: str
    unit: str
    white: float
    usual: float


@dc.dataclass(frozen=True)
class FlightFacts:
    """Facts of one flight that need no vehicle.

    step: median interval [s].
    gaps: intervals longer than 2.5 of it; longest: the longest interval [s]; bridged: rows that a
        reader put into gaps. misfits: by law, disagreement of quantities with each other: 0
        agree, 1 do not [1]. motion: by quantity, RMS or span, with the unit in the key.
    saturated: share of rows with a rotor at a limit [1]; None where no limit is known.
    imported: what its import did; empty for a log of our format.
    """

    name: str
    duration: float
    rows: int
    step: float
    gaps: int
    longest: float
    bridged: int
    input: str
    timing: float
    signals: tuple[SignalFacts, ...]
    misfits: dict[str, float]
    lags: tuple[Lag, ...]
    motion: dict[str, float]
    saturated: float | None = None
    notes: tuple[str, ...] = ()
    imported: dict[str, Any] = dc.field(default_factory=dict)


MOST_RESIDUAL = 0.25  # of the weight, from which it is said first [1]
# Of the weight along body z, from which thrust does not carry the vehicle: no payload or weak rotor
# is that large [1]; own choice.
NO_LIFT = 0.5
CLEAR = 0.5  # correlation of torque with J dw/dt from which sign and size are told [1]; own choice
# of the torque that turned the vehicle over the model's, beyond which a law fails [1]; own choice
FACTOR = 3.0
# Of a flight in which noise of its attitude, and agreement, are looked for; own choice.
MOST_ROWS = 60_000
LEAST_STEP = 0.02  # of the rows on which it is looked for [s]


def findings_on(flight: FlightResiduals) -> list[Finding]:
    """Return what stands against a flight with a vehicle, the residual first."""
    log = flight.log
    stated = [finding.of(log.name) for finding in shown_at(log.findings, Place.ANSWER)]
    return [*_residual(flight), *_torque(flight), *law_findings(log), *stated]


def law_findings(log: FlightLog) -> list[Finding]:
    """Return what stands against a flight without knowing its vehicle."""
    t, x = _evenly(log)
    by_law = misfits(t, x)
    if level := never_tilts(t, x):
        tilt, needed = level
        what = (
            f"the attitude never tilts ({1e3 * tilt:.2g} mrad) where the vehicle accelerates "
            f"sideways ({1e3 * needed:.0f} mrad): its pose is planar"
        )
        return [Finding(Kind.CONTRADICTION, log.name, what)]
    aside = told_by_noise(by_law)
    failed = failing(by_law)
    findings = [finding.of(log.name) for finding in shown_at(log.findings, Place.FAILURE)]
    clips = any(finding.kind is Kind.CLIPPING for finding in log.findings)
    noisy = [law for law in aside if not (clips and law.startswith("velocity"))]
    lift = [law for law in failed if law.startswith("lift")]
    if other := [law for law in failed if law not in (*aside, *lift)]:
        text = f"{', '.join(other)} contradict each other; check columns, frames and units"
        findings.append(Finding(Kind.CONTRADICTION, log.name, text))
    if lift:
        opposed = any(by_law[law] >= OPPOSED for law in lift)
        what = f"{misfit_text(lift, by_law)}: horizontal acceleration is not along the thrust axis"
        why = (
            "check attitude and frames"
            if opposed
            else "another force acts, or the attitude is wrong"
        )
        kind = Kind.CONTRADICTION if opposed else Kind.DOUBT
        findings.append(Finding(kind, log.name, f"{what}; {why}"))
    if noisy:
        text = f"{misfit_text(noisy, by_law)}: no more than noise or drift of a sensor"
        findings.append(Finding(Kind.DOUBT, log.name, text))
    late = ", ".join(
        f"{lag.late} {1e3 * lag.seconds:+.0f} ms after {lag.early}"
        for lag in lags_of_state(log).values()
        if lag.beyond_doubt
    )
    if late:
        text = f"{late}: stamps of two clocks; np-drake import takes that out"
        findings.append(Finding(Kind.DOUBT, log.name, text))
    return findings


def lags_of_state(log: FlightLog) -> dict[str, Lag]:
    """Return the lags between states that the log tells (`state_lags`)."""
    t, x = _evenly(log, FINEST)
    return state_lags({name: Signal(t, values) for name, values in x.items()})


def _evenly(log: FlightLog, finest: float = LEAST_STEP) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return evenly spaced times and the quantities at them, of the first `MOST_ROWS` rows."""
    log = log.rows(0, MOST_ROWS)
    x = {LOOKS[f][0]: getattr(log, f) for f in "pv" if UNLOGGED[f] not in log.lacks}
    x["rates"] = log.w
    if log.a is not None:
        g = np.array([0.0, 0.0, GRAVITY])
        # Without attitude as `convert` leaves it: the specific force in body axes, less g.
        x["acceleration"] = (
            attitude.rotate_back(log.q, log.a + g) - g if "attitude" in log.lacks else log.a
        )
    even = np.arange(log.t[0], log.t[-1], max(log.step, finest))
    at = {name: Signal(log.t, values).linear(even) for name, values in x.items()}
    if "attitude" not in log.lacks:
        q = Signal(log.t, attitude.one_hemisphere(log.q, log.q[0])).linear(even)
        at["attitude"] = attitude.normalised(q)
    return even, at


def _residual(flight: FlightResiduals) -> list[Finding]:
    share = np.sqrt(np.mean(flight.y[~flight.outliers, FORCE] ** 2, axis=0)) / flight.weight
    worst = int(np.argmax(share))
    if share[worst] <= MOST_RESIDUAL:
        return []
    what = (
        f"the vehicle file misses {share[worst]:.0%} of the weight along body {'xyz'[worst]}: "
        "check mass, thrust coefficient, units and columns before any answer"
    )
    kind = Kind.CONTRADICTION if share[2] > NO_LIFT else Kind.DOUBT
    return [Finding(kind, flight.name, what)]


def _torque(flight: FlightResiduals) -> list[Finding]:
    """Return the findings on the torque by its correlation with J dw/dt + w x J w, and by the size
    of both.
    """
    agreement = torque_agreement(flight.log, flight.vehicle) if flight.knows_torque else None
    if agreement is None:
        return []
    out = []
    for axis, correlation, ratio in zip("xyz", *agreement, strict=True):
        what = ""
        if correlation < -CLEAR:
            what = (
                f"goes against J dw/dt (correlation {correlation:.2f}); check signs and the order "
                "of the rotors"
            )
        # Noise lies on both: the factor is between the regressions of one on the other.
        elif correlation > CLEAR and (
            correlation * ratio > FACTOR or ratio / correlation < 1 / FACTOR
        ):
            what = (
                f"is not what turns the vehicle, {ratio:.2g} times as much; check inertia, arms "
                "and torque coefficient"
            )
        if what:
            text = f"torque about body {axis} {what}"
            out.append(Finding(Kind.CONTRADICTION, flight.name, text))
    return out


def lags(log: FlightLog, vehicle: Vehicle | None = None) -> tuple[Lag, ...]:
    """Return the lags between states, and between command and response, as far as the log tells
    them.

    Args:
        vehicle: for the torque of measured rotor speed; None: that lag is left out.
    """
    each: list[Lag | None] = [*lags_of_state(log).values()]
    rise = Signal(log.t, log.v).rate
    up = attitude.body_z(Signal(log.t, log.q).turned(None, rise.t))
    lift = np.sum((rise.values + [0.0, 0.0, 9.81]) * up, axis=1)[:, None]
    # a held command acts half a row later
    acting = log.t if log.input == "rotor_speed" else log.t + 0.5 * log.step
    lifting = {"thrust": log.u[:, :1] if log.throttle is None else log.throttle}
    asked = lift_of(lifting if log.rotor is None else {"rotor_speed": log.rotor})
    each.append(lag_of("lift", "thrust", Signal(rise.t, lift), Signal(acting, asked[:, None])))
    u = log.u[:, 1:]
    if np.isfinite(u).all() and (log.input != "rotor_speed" or vehicle is not None):
        each.append(lag_of("turning", "torque", Signal(log.t, log.w).rate, Signal(acting, u)))
    return tuple(lag for lag in each if lag is not None)


GAP = 2.5  # median intervals of a longer one, a gap [1]; as in the import
NEAR_LIMIT = 0.99  # share of a rotor's largest thrust from which it is saturated [1]; own choice
SIGNALS = (  # field of the log, name, unit, field of `MeasurementNoise`
    ("p", "position", "m", "position"),
    ("v", "velocity", "m/s", "velocity"),
    ("w", "body rates", "rad/s", "rate"),
    ("a", "acceleration", "m/s²", "acceleration"),
    ("rotor", "rotor speed", "rad/s", ""),
    ("throttle", "throttle", "1", ""),
)


def flight_facts(log: FlightLog, vehicle: Vehicle | None = None) -> FlightFacts:
    """Return the facts of a flight.

    Args:
        vehicle: for limits of the rotors and the usual noise of its sensors; None: neither is
            known, and usual sensors are taken.
    """
    interval = np.diff(log.t)
    usual = MeasurementNoise() if vehicle is None else vehicle.measurement_noise
    return FlightFacts(
        name=log.name,
        duration=float(log.t[-1] - log.t[0]),
        rows=len(log),
        step=log.step,
        gaps=int(np.sum(interval > GAP * log.step)),
        longest=float(interval.max()),
        bridged=int(log.in_gap.sum()),
        input=log.input,
        timing=log.timing,
        signals=tuple(_signals(log, usual)),
        misfits=misfits(*_evenly(log)),
        lags=lags(log, vehicle),
        motion=motion_of([log]),
        saturated=_saturated(log, vehicle),
        notes=tuple(map(str, log.findings)),
    )


def _signals(log: FlightLog, usual: MeasurementNoise):
    known = dc.asdict(usual)
    for field, name, unit, sensor in SIGNALS:
        values = getattr(log, field)
        integrated = field in "pv" and UNLOGGED[field] in log.lacks
        if integrated or values is None or not np.isfinite(values).all():
            continue
        yield SignalFacts(name, unit, float(white_noise([values]).max()), known.get(sensor, 0.0))


def motion_of(logs: Sequence[FlightLog]) -> dict[str, float]:
    """Return RMS values over all rows of flights, their largest speed, span of heights and lowest
    height, with the unit in the key; 0 of what was not logged.
    """

    def rms(values: np.ndarray) -> float:
        return float(np.sqrt(np.mean(np.sum(values**2, axis=1))))

    up = attitude.body_z(np.concatenate([log.q for log in logs]))[:, 2]
    tilt = np.degrees(np.arccos(np.clip(up, -1, 1)))
    v = np.concatenate([log.v * ("velocity" not in log.lacks) for log in logs])
    z = np.concatenate([log.p[:, 2] * ("height" not in log.lacks) for log in logs])
    return {
        "speed [m/s]": rms(v),
        "fastest [m/s]": float(np.linalg.norm(v, axis=1).max()),
        "rate [rad/s]": rms(np.concatenate([log.w for log in logs])),
        "tilt [deg]": float(np.sqrt(np.mean(tilt**2))),
        "height span [m]": float(np.ptp(z)),
        "lowest [m]": float(z.min()),
    }


def _saturated(log: FlightLog, vehicle: Vehicle | None) -> float | None:
    """Return the share of rows in which a rotor is at a limit [1]; None where no limit is known."""
    if vehicle is None or not np.isfinite(log.u).all():
        return None
    share = log.u @ vehicle.unmixer.T / vehicle.max_rotor_thrust
    return float(np.mean(np.any((share > NEAR_LIMIT) | (share < 1 - NEAR_LIMIT), axis=1)))


def bridged_rows(logs: Sequence[FlightLog]) -> list[str]:
    """Return one line on the rows that readers put into short gaps of flights; none where there are
    none.
    """
    counts = [int(log.in_gap.sum()) for log in logs]
    if not any(counts):
        return []
    share = sum(counts) / sum(map(len, logs))
    return [
        f"{sum(counts)} rows ({percent(share)}) in gaps of {sum(map(bool, counts))} of {len(logs)} "
        "flights were filled in; they do not count in the answer, and below 10 % nothing needs to "
        "be done."
    ]
