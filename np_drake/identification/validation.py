"""Identified model on flights that it has not seen, beside the vehicle file.

Open-loop predictions run the model from logged states on, driven by what turned the rotors.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from np_drake import attitude
from np_drake.effects.base import chi_from_body
from np_drake.flight_log import FlightLog
from np_drake.identification.estimation import Layout, estimate
from np_drake.identification.identify import Identification
from np_drake.identification.model import FORCE, TORQUE, FlightModel, Frame, Values, inertia
from np_drake.identification.signals import G, signals
from np_drake.rigid_body import INPUT_SIZE, P, Q, V, W, runge_kutta, state_derivative
from np_drake.vehicle import Vehicle

# of a bin; own choice: half of 10 ms, at which the fourth-order rule is exact for a rigid body
INTEGRATION_SUBSTEPS = 2
START_INTERVAL = 0.1  # between the starts of predictions [s]
ERRORS = ("position", "velocity", "attitude", "rates")  # [m, m/s, rad, rad/s]


def predict(
    model: FlightModel, log: FlightLog, v: Values, *, seconds: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the first bins (s,) of open-loop predictions, and their errors (k + 1, s, 4), of
    `ERRORS`, at the start and after each bin.

    Args:
        seconds: length of a prediction [s].
    """
    s = model.flight
    steps = max(1, round(seconds / s.step))
    apart = max(1, round(START_INTERVAL / s.step))
    first = np.arange(0, len(s) - steps, apart)
    first = np.array([b for b in first if s.good[b : b + steps].all()], int)
    if not len(first):
        raise ValueError(f"{log.name}: no stretch of {seconds:g} s without gaps to predict.")
    center = model.center(v)
    J = inertia(v) * model.frame.arm**2
    vehicle = dc.replace(model.frame.vehicle, inertia=J.tolist())
    x = at_point(log.x[s.edges[first]], center)
    rotors = model.rotors(v)

    def rate(bins: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the rates of change (s, 13) of states x (s, 13) of the centre of mass."""
        turning = rotors.at(bins)
        motion = model.motion(x, turning)
        force, torque = np.split(model.wrench(v, motion, turning), 2, axis=1)
        chi = chi_from_body(motion, force, torque)
        return state_derivative(vehicle, x, np.zeros(INPUT_SIZE), chi)

    out = [x]
    h = s.step / INTEGRATION_SUBSTEPS
    for k in range(steps):
        for _ in range(INTEGRATION_SUBSTEPS):
            x = runge_kutta(partial(rate, first + k), x, h)
            x[:, Q] = attitude.normalised(x[:, Q])
        out.append(x)
    states = at_point(np.array(out), -center)
    logged = log.x[s.edges[first + np.arange(steps + 1)[:, None]]]
    off = states - logged
    between = attitude.multiply(attitude.conjugate(logged[..., Q]), states[..., Q])
    parts = (off[..., P], off[..., V], attitude.rotation_vector(between), off[..., W])
    return first, np.stack([np.linalg.norm(part, axis=-1) for part in parts], axis=-1)


def at_point(x: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return the states (..., 13) of a point that lies at a place (3,) from that of x, in body axes
    [m].
    """
    out = x.copy()
    out[..., P] += attitude.rotate(x[..., Q], place)
    out[..., V] += attitude.rotate(x[..., Q], np.cross(x[..., W], place))
    return out


HORIZONS = (0.1, 0.5)  # of open-loop prediction [s]
ADAPTED = 5.0  # beginning of a held-out flight that tells its own parameters [s]; own choice
LARGEST_SHARE = 0.3  # of the flight at most [1]; own choice


@dc.dataclass(frozen=True)
class HeldOutErrors:
    """Errors of one model on one held-out part.

    force: (3,) RMS of the residual force [N].
    torque: (3,) of the residual angular acceleration times the identified inertia, so that models
        compare [N·m]; NaN where a collective tells none.
    open_loop: (horizons, 4) median errors of `ERRORS` after `HORIZONS`; NaN where the log has no
        states.
    """

    flight: str
    model: str
    force: np.ndarray
    torque: np.ndarray
    open_loop: np.ndarray


def vehicle_values(
    vehicle: Vehicle, frame: Frame, drive: str, mass: float, fixed: Values
) -> Values:
    """Return the parameters of the model as a vehicle file has them.

    Args:
        mass: with which forces are divided [kg].
        fixed: parameters of which a file says nothing, by name; they count as absent.
    """
    J = vehicle.J
    arm = frame.arm
    c = vehicle.calibration
    xx, yy, zz = np.diag(J) / (mass * arm**2)
    mean = 0.5 * (xx + yy)
    xy, xz, yz = (-J[i, k] / (mass * arm**2) / mean for i, k in ((0, 1), (0, 2), (1, 2)))
    weight = 0.25 * mass * G
    curve = 0.0 if vehicle.throttle is None else vehicle.throttle.linear
    scale = 1.0
    if drive == "rotor_speed":
        scale = vehicle.thrust_coefficient * frame.unit**2 / weight
    elif drive == "command":
        scale = frame.unit / weight
    elif vehicle.throttle is not None and drive == "throttle":
        scale = float(vehicle.throttle.thrust(frame.unit, frame.volts)) / weight
    gains = np.linalg.lstsq(frame.patterns.T, np.array(c.rotor_gains) - 1.0, rcond=None)[0]
    imu = np.array(c.imu_position or [0.0, 0.0, 0.0]) / arm
    up = max(vehicle.rotor_time_constant, 1e-6)
    down = c.rotor_time_constant_down or up
    spin = (
        frame.unit
        if drive == "rotor_speed"
        else float(np.sqrt(weight / vehicle.thrust_coefficient))
    )
    return dict.fromkeys(fixed, 0.0) | {
        "scale": scale,
        "charge": 1.0,
        **dict(zip(("gain_roll", "gain_pitch", "gain_yaw"), gains.tolist(), strict=True)),
        **{f"com_{a}": c.center_of_mass[i] / arm for i, a in enumerate("xyz")},
        "jxx": xx,
        "jyy": yy / xx,
        "jzz": zz / (xx + yy),
        "jxy": xy,
        "jxz": xz,
        "jyz": yz,
        "torque": vehicle.torque_coefficient / vehicle.thrust_coefficient / frame.radius,
        "rotor_momentum": c.rotor_inertia * spin / J[2, 2],
        **{f"imu_{a}": float(imu[i]) for i, a in enumerate("xyz")},
        **{f"tilt_{a}": float(c.imu_tilt[i]) for i, a in enumerate("xyz")},
        "lag": up,
        "lag_ratio": down / up,
        "delay": c.command_delay,
        "clock": -c.clock_offset,
        "curve": curve,
        "idle": 0.0,
        "slope": 1.5,
        "bend": 0.375,
        "sag": 0.0 if vehicle.throttle is None else vehicle.throttle.voltage_exponent,
        "full_speed": 1.0,
        "window": 0.5,
    }


def held_out_errors(
    identification: Identification, logs: Sequence[FlightLog], start: float = 0.0
) -> list[HeldOutErrors]:
    """Return the errors on flights that the identification has not seen.

    The first seconds of each tell what is its own: battery, where that lies, clock and errors of
    sensors. They are not scored. start: share of each flight that does not count [1].
    """
    basis = identification.basis
    identified = identification.estimate.layout.values(identification.estimate.z)
    mass = basis.mass_of(identified)
    J = mass * basis.frame.arm**2 * inertia(identified)
    rows = {
        "vehicle file": vehicle_values(
            identification.prior, basis.frame, basis.drive, mass, identified
        ),
        "identified": identified,
    }
    untold = basis.drive == "collective"
    out = []
    for log in logs:
        model, parameters = adapted(identification, log, start, rows)
        for name, v in parameters.items():
            e = model.residual(v)[model.flight.good]
            force = mass * np.sqrt(np.mean(e[:, FORCE] ** 2, axis=0))
            torque = np.sqrt(np.mean((e[:, TORQUE] @ J.T) ** 2, axis=0))
            torque = np.full(3, np.nan) if untold else torque
            open_loop = np.full((len(HORIZONS), len(ERRORS)), np.nan)
            for i, horizon in enumerate(() if log.lacks or untold else HORIZONS):
                try:
                    _, errors = predict(model, log, v, seconds=horizon)
                    open_loop[i] = np.median(errors[-1], axis=0)
                except ValueError:  # no stretch without gaps is as long
                    continue
            out.append(HeldOutErrors(log.name, name, force, torque, open_loop))
    return out


def adapted(
    identification: Identification, log: FlightLog, start: float, rows: Mapping[str, Values]
) -> tuple[FlightModel, dict[str, Values]]:
    """Return the part of a flight that is scored, and parameters with the flight's own as its first
    seconds tell them.

    Args:
        start: share of the flight that does not count [1].
    """
    flight = signals(log, identification.prior.unmixer, identification.basis.drive)
    frame = identification.basis.frame
    begin = start + min(ADAPTED / (log.t[-1] - log.t[0]), LARGEST_SHARE * (1.0 - start))
    early = [FlightModel(flight.part(start, begin), frame)]
    per_flight = identification.estimate.layout.per_flight
    parameters = {}
    for name, values in rows.items():
        layout = Layout((), per_flight, 1, values)
        parameters[name] = layout.values(estimate(early, layout).z, 0)
    return FlightModel(flight.part(begin, 1.0), frame), parameters
