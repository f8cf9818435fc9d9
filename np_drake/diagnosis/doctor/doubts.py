"""What stands against any answer from a flight, whatever its cause: laws that fail, and a large
share of the weight.

`np-drake doctor` says it first, and a diagnosis before its answer.
"""

import dataclasses as dc
from collections.abc import Iterable, Sequence

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.residuals import FORCE, FlightResiduals
from np_drake.flight_log import FlightLog
from np_drake.logs import inputs, rotors
from np_drake.logs.clock import FINEST, Lag, state_lags
from np_drake.logs.importing.laws import (
    OPPOSED,
    SCALE,
    failing,
    misfits,
    never_tilts,
    told_by_noise,
)
from np_drake.logs.importing.log_map import GRAVITY
from np_drake.logs.importing.signals import Signal
from np_drake.logs.rotors import torque_agreement

MOST_RESIDUAL = 0.25  # of the weight, from which it is said first [1]
# Of the weight along body z, from which thrust does not carry the vehicle: no payload or weak rotor
# is that large [1]; own choice.
NO_LIFT = 0.5
TOLD = 0.5  # correlation of torque with J dw/dt from which sign and size are told [1]; own choice
# of the torque that turned the vehicle over the model's, beyond which a law fails [1]; own choice
FACTOR = 3.0
MOST_ROWS = 60_000  # of a flight whose agreement is looked for; own choice
LEAST_STEP = 0.02  # of the rows on which it is looked for [s]


@dc.dataclass(frozen=True)
class Doubt:
    """A reason to doubt all answers from a flight. fails: a law fails, and the flight is not
    usable.
    """

    flight: str
    what: str
    fails: bool = False


def as_lines(found: Iterable[Doubt]) -> tuple[str, ...]:
    """Return one line for each reason, which names all its flights."""
    flights: dict[str, list[str]] = {}
    for doubt in found:
        flights.setdefault(doubt.what, []).append(doubt.flight)
    return tuple(f"{', '.join(names)}: {what}" for what, names in flights.items())


def doubts(flight: FlightResiduals) -> list[Doubt]:
    """Return what stands against a flight with a vehicle, the residual first."""
    log = flight.log
    return [*_residual(flight), *_torque(flight), *law_doubts(log), *_taken_over(log)]


def law_doubts(log: FlightLog) -> list[Doubt]:
    """Return what stands against a flight without knowing its vehicle."""
    t, x = _evenly(log)
    own = misfits(t, x)
    if level := never_tilts(t, x):
        tilt, needed = level
        flat = (
            f"the attitude never tilts ({1e3 * tilt:.2g} mrad) where the vehicle accelerates "
            f"sideways"
        )
        return [
            Doubt(log.name, f"{flat} ({1e3 * needed:.0f} mrad): its pose is planar", fails=True)
        ]
    aside = told_by_noise(own)
    lift = [law for law in failing(own) if law.startswith("lift")]
    other = [law for law in failing(own) if law not in (*aside, *lift)]
    found = []
    if other:
        laws = f"{', '.join(other)} contradict each other"
        found.append(Doubt(log.name, f"{laws}; check columns, frames and units", fails=True))
    if lift:
        opposed = any(own[law] >= OPPOSED for law in lift)
        what = (
            f"misfit of {_shown(lift, own)} ({SCALE}): horizontal acceleration is not along "
            f"the thrust axis"
        )
        why = (
            "check attitude and frames"
            if opposed
            else "another force acts, or the attitude is wrong"
        )
        found.append(Doubt(log.name, f"{what}; {why}", fails=opposed))
    if aside:
        what = f"misfit of {_shown(aside, own)} ({SCALE}): no more than noise or drift of a sensor"
        found.append(Doubt(log.name, what))
    late = [lag for lag in lags_of_state(log).values() if lag.beyond_doubt]
    if late:
        what = ", ".join(
            f"{lag.late} {1e3 * lag.seconds:+.0f} ms after {lag.early}" for lag in late
        )
        found.append(
            Doubt(log.name, f"{what}: stamps of two clocks; np-drake import takes that out")
        )
    return found


def agreement(log: FlightLog) -> dict[str, float]:
    """Return the misfit of every law of consistency that the log can test
    (`consistency.misfits`).
    """
    return misfits(*_evenly(log))


def lags_of_state(log: FlightLog) -> dict[str, Lag]:
    """Return the lags between states that the log tells (`state_lags`)."""
    t, x = _evenly(log, FINEST)
    return state_lags({name: Signal(t, values) for name, values in x.items()})


def _evenly(log: FlightLog, finest: float = LEAST_STEP) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return evenly spaced times and the quantities at them, of the first `MOST_ROWS` rows."""
    log = log.rows(0, MOST_ROWS)
    x = {"rates": log.w}
    x |= {name: values for name, (lack, values) in _logged(log).items() if lack not in log.lacks}
    if log.a is not None:
        g = np.array([0.0, 0.0, GRAVITY])
        # Without attitude as `convert` leaves it: the specific force in body axes, less g.
        x["acceleration"] = (
            attitude.rotate_back(log.q, log.a + g) - g if "attitude" in log.lacks else log.a
        )
    even = np.arange(log.t[0], log.t[-1], max(log.step, finest))
    near = np.cumprod(
        np.concatenate([[1.0], np.where(np.sum(log.q[1:] * log.q[:-1], axis=1) < 0, -1.0, 1.0)])
    )
    if "attitude" in x:
        x["attitude"] = log.q * near[:, None]
    at = {
        name: np.stack([np.interp(even, log.t, c) for c in values.T], axis=1)
        for name, values in x.items()
    }
    if "attitude" in at:
        at["attitude"] /= np.linalg.norm(at["attitude"], axis=1, keepdims=True)
    return even, at


def _logged(log: FlightLog) -> dict[str, tuple[str, np.ndarray]]:
    """Return the states of a log by quantity, each with what `lacks` says where it was
    integrated.
    """
    return {
        "position": ("height", log.p),
        "velocity": ("velocity", log.v),
        "attitude": ("attitude", log.q),
    }


def _residual(e: FlightResiduals) -> list[Doubt]:
    share = np.sqrt(np.mean(e.y[~e.outliers, FORCE] ** 2, axis=0)) / e.weight
    worst = int(np.argmax(share))
    if share[worst] <= MOST_RESIDUAL:
        return []
    where = f"{share[worst]:.0%} of the weight along body {'xyz'[worst]}"
    remedy = "check mass, thrust coefficient, units and columns before any answer"
    return [
        Doubt(e.name, f"the vehicle file misses {where}: {remedy}", fails=bool(share[2] > NO_LIFT))
    ]


def _torque(e: FlightResiduals) -> list[Doubt]:
    """Return the doubts about the torque by its correlation with J dw/dt + w x J w, and by the size
    of both.
    """
    found = torque_agreement(e.log, e.vehicle) if e.knows_torque else None
    if found is None:
        return []
    out = []
    for axis, correlation, ratio in zip("xyz", *found, strict=True):
        about = f"torque about body {axis}"
        if correlation < -TOLD:
            what = f"goes against J dw/dt (correlation {correlation:.2f})"
            out.append(
                Doubt(
                    e.name, f"{about} {what}; check signs and the order of the rotors", fails=True
                )
            )
        # Noise lies on both: the factor is between the regressions of one on the other.
        elif correlation > TOLD and (
            correlation * ratio > FACTOR or ratio / correlation < 1 / FACTOR
        ):
            what = f"is not what turns the vehicle, {ratio:.2g} times as much"
            out.append(
                Doubt(
                    e.name,
                    f"{about} {what}; check inertia, arms and torque coefficient",
                    fails=True,
                )
            )
    return out


def _taken_over(log: FlightLog) -> list[Doubt]:
    """Return what a reader found of order and coefficient of the rotors, which is not that of the
    vehicle file.
    """
    known = (rotors.NOTE, inputs.COEFFICIENT_NOTE)
    return [Doubt(log.name, note) for note in log.notes if note.startswith(known)]


def _shown(laws: Sequence[str], own: dict[str, float]) -> str:
    return ", ".join(f"{law} {own[law]:.2g}" for law in laws)
