"""Facts of one flight log that need no vehicle: rows, gaps, noise of signals, conventions, lags and
motion.
"""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.doctor.doubts import agreement
from np_drake.diagnosis.doctor.lags import lags
from np_drake.diagnosis.doctor.log_report import FlightFacts, SignalFacts
from np_drake.diagnosis.residuals import smooth_attitude
from np_drake.flight_log import FlightLog
from np_drake.training_data.segments import white_noise
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle

GAP = 2.5  # median intervals of a longer one, a gap [1]; as in the import
NEAR_LIMIT = 0.99  # share of a rotor's largest thrust from which it is saturated [1]; own choice
MOST_ROWS = (
    60_000  # of a flight in which noise of its attitude, and agreement, are looked for; own choice
)
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
    head = log.rows(0, MOST_ROWS)
    _, attitude_noise = smooth_attitude(head.t, head.q, head.w)
    usual = MeasurementNoise() if vehicle is None else vehicle.measurement_noise
    return FlightFacts(
        name=log.name,
        duration=float(log.t[-1] - log.t[0]),
        rows=len(log),
        step=log.step,
        jitter=float(np.std(interval[interval < GAP * log.step]) / log.step),
        gaps=int(np.sum(interval > GAP * log.step)),
        longest=float(interval.max()),
        bridged=0 if log.bridged is None else int(log.bridged.sum()),
        input=log.input,
        timing=log.timing,
        signals=tuple(_signals(log, usual)),
        attitude_noise=attitude_noise,
        misfits=agreement(head),
        lags=lags(log, vehicle),
        motion=_motion(log),
        saturated=_saturated(log, vehicle),
        notes=tuple(log.notes),
    )


def _signals(log: FlightLog, usual: MeasurementNoise):
    known = dc.asdict(usual)
    integrated = {"p": "height", "v": "velocity"}
    for field, name, unit, sensor in SIGNALS:
        values = getattr(log, field)
        if integrated.get(field) in log.lacks or values is None or not np.isfinite(values).all():
            continue
        yield SignalFacts(
            name, unit, float(white_noise([values]).max()), known.get(sensor, 0.0), *_grain(values)
        )


def _grain(values: np.ndarray) -> tuple[float, float]:
    """Return the step to which values are rounded, 0 where noise hides it, and the share of
    repeated rows.
    """
    change = np.abs(np.diff(values, axis=0))
    repeated = float(np.mean(~change.any(axis=1)))
    steps = []
    for column in change.T:
        moved = column[column > 1e-12]
        if len(moved) < 20:
            continue
        least = float(np.percentile(moved, 1))
        whole = np.abs(moved / least - np.round(moved / least)) < 0.02
        if whole.mean() > 0.95 and np.median(moved) < 20 * least:
            steps.append(least)
    return max(steps, default=0.0), repeated


def _motion(log: FlightLog) -> dict[str, float]:
    def rms(values: np.ndarray) -> float:
        return float(np.sqrt(np.mean(np.sum(values**2, axis=1))))

    tilt = np.degrees(np.arccos(np.clip(attitude.body_z(log.q)[:, 2], -1, 1)))
    v, z = log.v * ("velocity" not in log.lacks), log.p[:, 2] * ("height" not in log.lacks)
    return {
        "speed [m/s]": rms(v),
        "fastest [m/s]": float(np.linalg.norm(v, axis=1).max()),
        "rate [rad/s]": rms(log.w),
        "tilt [deg]": float(np.sqrt(np.mean(tilt**2))),
        "height span [m]": float(np.ptp(z)),
        "lowest [m]": float(z.min()),
    }


def _saturated(log: FlightLog, vehicle: Vehicle | None) -> float | None:
    """Return the share of rows in which a rotor is at a limit [1]; None where no limit is known."""
    if vehicle is not None and np.isfinite(log.u).all():
        thrust = log.u @ vehicle.unmixer.T
        most = NEAR_LIMIT * vehicle.max_rotor_thrust
        least = (1 - NEAR_LIMIT) * vehicle.max_rotor_thrust
        return float(np.mean(np.any((thrust > most) | (thrust < least), axis=1)))
    return None
