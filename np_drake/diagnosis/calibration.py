"""Calibration: what healthy vehicles differ by from their file, and flights from one another.

It is part of every model and no cause: columns of the regression in units of documented standard
deviations. Lengths count in mean arms, moments in weight times arm.
The share of the rotors' torque to which the motion responds comes before everything else:
controllers run faster than logs, and of logged torque the motion may show a small part.
J dw/dt = gain (torque of rotors and effects) holds for both. Torque that trims a moment of the air
or
of a payload does not count: effects explain it.
"""

import dataclasses as dc
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.deviation import ROTORS, Deviation, columns_of, file_deviations
from np_drake.diagnosis.fitting import Fit, LinearPart
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.options import SPREAD, SURE, Priors, Spread, Tolerance
from np_drake.diagnosis.regressors import LINEAR, PREFIX, Candidate, generic_candidates
from np_drake.diagnosis.regressors.library import THROTTLE_CURVE
from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals
from np_drake.diagnosis.result import Difference
from np_drake.effects import (
    AccelerometerBias,
    AttitudeBias,
    AttitudeLatency,
    BatterySag,
    BladeFlapping,
    CenterOfMassOffset,
    ClockOffset,
    CommandDelay,
    GyroBias,
    ImuMounting,
    InertiaError,
    MassError,
    MixerGain,
    MotorLag,
    RotorGyroscopic,
    ThrottleCurve,
    ThrustScale,
    TranslationalLift,
    VelocityBias,
    WeakRotor,
)
from np_drake.effects.base import ActuatorEffect, Effect, Parameter, SensorEffect, arm, departure
from np_drake.effects.calibration import in_flight
from np_drake.files.number_text import number
from np_drake.logs.inputs import VOLTAGE_SCATTER, hover_exponent, voltage_of
from np_drake.rigid_body import V
from np_drake.vehicle.published import published_priors

AXES, BATTERY = ("roll", "pitch", "yaw"), (ThrustScale, BatterySag)
SENSORS = (AccelerometerBias, AttitudeBias, GyroBias, VelocityBias)
LEANING = 2  # last columns of the airframe: thrust that leans to x and y


def of_vehicle(
    e: FlightResiduals, tolerance: Tolerance, spread: Spread = SPREAD
) -> list[Deviation]:
    """Return by what a healthy vehicle differs from its file; nothing where that which flew was
    measured.

    Of a number for which the file states an interval, the deviation is that of the interval, but
    not less than 1e-3 of that of healthy vehicles.
    """
    vehicle, measured = e.vehicle, e.measured_rotors
    if not tolerance.unmeasured:
        return []
    span, mass = arm(vehicle), vehicle.mass

    def stated(field: str, *healthy: float) -> list[float]:
        found, name = [], f"calibration.{field}"
        for i, usual in enumerate(healthy):
            known = vehicle.known_within(name, *[i] * (len(healthy) > 1))
            found.append(usual if known is None else max(known, 1e-3 * usual))
        return found

    gains = zip(ROTORS, stated("rotor_gains", *[spread.rotor_gain] * 4), strict=True)
    level, height = spread.center_of_mass * span, spread.center_of_mass_height * span
    center = stated("center_of_mass", level, level, height)
    usual_inertia = published_priors().rotor_inertia.median * mass * span**2
    (inertia,) = stated("rotor_inertia", usual_inertia)
    (clock,) = stated("clock_offset", spread.rotor_speed_time if measured else spread.command_time)
    found = [
        *(Deviation(WeakRotor, {"efficiency": gain}, {"rotor": i}) for i, gain in gains),
        Deviation(CenterOfMassOffset, dict(zip("xyz", center, strict=True))),
        Deviation(MixerGain, dict.fromkeys(AXES, spread.torque_gain)),
        Deviation(BladeFlapping, {"moment": spread.flapping * mass * span}),
        Deviation(TranslationalLift, {"lift": spread.lift * mass}),
        Deviation(RotorGyroscopic, {"rotor_inertia": inertia}),
        Deviation(ClockOffset, {"offset": clock}),
    ]
    if "attitude" not in e.log.lacks:
        tilt = stated("imu_tilt", *[spread.mounting] * 3)
        found.append(Deviation(ImuMounting, dict(zip(AXES, tilt, strict=True))))
        found.append(Deviation(AttitudeLatency, {"latency": spread.latency}))
    if e.log.a is not None:
        offset = dict.fromkeys("xyz", spread.accelerometer_offset)
        found.append(Deviation(AccelerometerBias, offset))
    if not measured:
        (delay,) = stated("command_delay", spread.command_time)
        found.append(Deviation(CommandDelay, {"delay": delay}))
        lags = spread.lags if "rotor_time_constant" not in vehicle.intervals else ()
        found += [Deviation(MotorLag, {"time_constant": lag}, at_value=True) for lag in lags]
    return found


def calibrated_alone(e: FlightResiduals, tolerance: Tolerance) -> set[str]:
    """Return the effects that are calibration whatever their size, and causes only where they begin
    in flight.

    A mass, where the scale of a throttle's map takes its place; of an unmeasured vehicle sensors,
    torque gains, inertia and times of commands.
    """
    found = {MassError.identifier} if e.log.input == "normalised" else set[str]()
    if tolerance.unmeasured:
        # Of inertia and the share of torque that acts a flight shows the ratio alone.
        found.add(InertiaError.identifier)
        for d in (*of_vehicle(e, tolerance), *of_flight(e, tolerance)):
            effect = d.effect
            sensor = effect.place == "measurement" or effect.role == "mixer"
            if sensor or effect.shifts_commands:
                found.add(effect.identifier)
    return found


def of_flight(e: FlightResiduals, tolerance: Tolerance, spread: Spread = SPREAD) -> list[Deviation]:
    """Return by what a flight differs from the others of its vehicle: sensors, and for an
    unmeasured vehicle trim.
    """
    usual = (spread.accelerometer, spread.tilt, spread.gyro, spread.velocity)
    found = []
    for effect, least in zip(SENSORS, usual, strict=True):
        error = max(tolerance.of(effect), least * tolerance.unmeasured)
        if effect is not AccelerometerBias or e.log.a is not None:
            names = [p.name for p in effect.parameters]
            found.append(Deviation(effect, dict.fromkeys(names, error)))
    if not tolerance.unmeasured:
        return [*found, *of_battery(e, spread)]
    trim = {"efficiency": spread.rotor_trim}
    found += [Deviation(WeakRotor, trim, {"rotor": i}) for i in ROTORS]
    known = {"scale": spread.known_charge}, {"rate": spread.known_sag}
    return found + (
        of_battery(e, spread) or [Deviation(*pair) for pair in zip(BATTERY, known, strict=True)]
    )


def of_battery(e: FlightResiduals, spread: Spread = SPREAD) -> list[Deviation]:
    """Return by what thrust over throttle differs from that of other flights, as the battery does;
    else nothing.
    """
    if e.log.input != "normalised":
        return []
    volts, charge, sag = voltage_of(e.log), spread.unknown_charge, spread.sag
    if volts is not None:
        # The power of a voltage that falls is known to a third: thrust falls by so much more or
        # less.
        fall = VOLTAGE_SCATTER * float(np.ptp(np.log(volts))) / float(np.ptp(e.log.t))
        charge, sag = spread.charge, float(np.hypot(spread.known_sag, fall))
    return [Deviation(BATTERY[0], {"scale": charge}), Deviation(BATTERY[1], {"rate": sag})]


# Smooth functions of velocity, attitude rate and thrust: what an airframe has and no effect of the
# library describes.
SMOOTH = ("rates", "side force", "velocity", "cross flow", "thrust curve", "command")
FLATTEST = 0.98  # of the sum of two moments of inertia that the third may reach [1]


def nuisance_of(
    flights: Sequence[FlightResiduals], tolerance: Tolerance, priors: Priors
) -> list[Candidate]:
    """Return all that every model holds, as columns with prior N(0, 1): errors of the file, what
    flights differ by, and what an unmeasured vehicle and its airframe differ by from the file.
    """
    found = [*file_errors(flights, tolerance), *flight_errors(flights, tolerance)]
    for of in vehicle_columns(flights, tolerance, priors):
        columns = {e.name: of(e) for e in flights}
        found.append(Candidate((), LINEAR, columns, lambda c: [], generic=of))
    return found


def vehicle_columns(
    flights: Sequence[FlightResiduals], tolerance: Tolerance, priors: Priors
) -> list[Callable[[FlightResiduals], np.ndarray]]:
    """Return functions that give the columns (m, 15, k) of any flight for what the vehicle and its
    airframe differ by; the last two are thrust that leans to x and y in the axes of the
    accelerometer.
    """
    shared = of_vehicle(flights[0], tolerance)
    if not shared:
        return []
    names = {f"{PREFIX}{name}" for name in SMOOTH}
    groups = [c for c in generic_candidates(flights, priors) if c.identifiers[0] in names]

    # A force in proportion to the velocity along the same axis is linear drag, an effect; unless it
    # does not grow with rotor speed as that does.
    drags = [np.zeros(c.size, bool) for c in groups]
    for c, own in zip(groups, drags, strict=True):
        if c.identifiers == (f"{PREFIX}velocity",):
            own[[7 * axis for axis in range(3)]] = True
    own_axis = np.concatenate(drags)

    def smooth(e: FlightResiduals) -> np.ndarray:
        return np.concatenate([c.generic(e) for c in groups if c.generic], axis=-1)

    # Beyond the usual motion a function of it stays within its prior, so that it does not grow with
    # speed cubed.
    span = arm(flights[0].vehicle)
    axes = np.array([1.0, 1.0, 1.0, 0.3 * span, 0.3 * span, 0.1 * span])
    usual = priors.generic_size * flights[0].weight * axes
    flown = np.concatenate([smooth(e)[:, WRENCH] for e in flights]) / usual[:, None]
    most = np.maximum(1.0, np.sqrt(np.mean(np.sum(flown**2, axis=1), axis=0)))

    def of_air(e: FlightResiduals) -> np.ndarray:
        columns, leaning = smooth(e) / most, np.zeros((*e.y.shape, LEANING))
        slower = 1.0 - np.sqrt(np.maximum(e.nominal[:, 2], 0.0) / e.weight)
        columns[..., own_axis] *= slower[:, None, None]
        leaning[:, 0, 0] = leaning[:, 1, 1] = SPREAD.mounting * e.nominal[:, 2]
        return np.concatenate([columns, leaning], axis=-1)

    return [partial(columns_of, deviations=shared), of_air]


def with_fixed_effects(flight: FlightResiduals) -> FlightResiduals:
    """Return the flight against the vehicle with the calibration of its file: its part that is not
    in the rotors.
    """
    fixed = tuple(e for e in in_flight(flight.vehicle) if not isinstance(e, ActuatorEffect))
    given = predicted_residual(flight, [Term(effect) for effect in fixed])
    wrench, y = given[:, WRENCH], flight.known(flight.y - given)
    return dc.replace(flight, y=y, nominal=flight.nominal + wrench, fixed=fixed, given=wrench)


def calibration_effects(fit: Fit, e: FlightResiduals, tolerance: Tolerance) -> list[Effect]:
    """Return the effects of the vehicle's calibration, without those of sensors, for a
    simulator.
    """
    every = [t.effect for t in fit.calibration]
    found: list[Effect] = [f for f in every if not isinstance(f, SensorEffect)]
    if not fit.calibrated:
        return found
    # A share of all torque is shown as if the inertia were larger, by as much as a rigid body can
    # have it.
    moments = e.vehicle.J.diagonal() / e.torque_gain
    moments = np.minimum(moments, FLATTEST * (moments.sum() - moments))
    found.append(InertiaError(*(moments / e.vehicle.J.diagonal())))
    coefficients = iter(fit.calibrated[0][1])
    for d in of_vehicle(e, tolerance):
        own = [
            c * deviation for deviation, c in zip(d.deviation.values(), coefficients, strict=False)
        ]
        if d.at_value or d.effect.place == "measurement" or d.effect.shifts_commands:
            continue
        parameters = {p.name: p for p in d.effect.parameters}
        moved = {name: (parameters[name], c) for name, c in zip(d.deviation, own, strict=True)}
        values = {n: float(np.clip(p.neutral + c, p.lower, p.upper)) for n, (p, c) in moved.items()}
        found.append(d.at(**values))
    return found


def file_errors(flights: Sequence[FlightResiduals], tolerance: Tolerance) -> list[Candidate]:
    """Return what every vehicle may differ by from its file, a candidate an effect."""
    found = []
    for d in file_deviations(flights[0].vehicle, tolerance):
        columns = {e.name: columns_of(e, [d], part=1.0) for e in flights}
        found.append(Candidate((), "calibration", columns, lambda c: []))
    return found


def flight_errors(flights: Sequence[FlightResiduals], tolerance: Tolerance) -> list[Candidate]:
    """Return what every flight differs by, a candidate a flight; none for ideal sensors."""
    found = []
    for e in flights if tolerance.real else ():
        own = errors_of(e, tolerance)
        columns = {o.name: np.broadcast_to(0.0, (*o.y.shape, own.shape[-1])) for o in flights}
        found.append(Candidate((), LINEAR, {**columns, e.name: own}, lambda c: []))
    return found


def errors_of(e: FlightResiduals, tolerance: Tolerance) -> np.ndarray:
    """Return columns (m, 15, k) of what a flight differs by from others of its vehicle."""
    constant = columns_of(e, of_flight(e, tolerance))
    if not tolerance.unmeasured:
        return constant
    return np.concatenate([constant, drift_columns(e)], axis=-1)


def drift_columns(e: FlightResiduals, spread: Spread = SPREAD) -> np.ndarray:
    """Return columns (m, 15, 6 k) of slow changes of each channel of the wrench: hats between k
    knots.

    Attitude and gyro drift, a battery sags and warms, trim changes: slower than the noise model
    remembers.
    """
    count = max(2, round((e.t[-1] - e.t[0]) / spread.drift_time) + 1)
    knots = np.linspace(e.t[0], e.t[-1], count)
    hats = np.stack([np.interp(e.t, knots, unit) for unit in np.eye(count)], axis=1)
    moment = spread.torque_drift * e.weight * arm(e.vehicle)
    level = spread.tilt_drift * e.weight
    # As much as a battery sags from knot to knot.
    thrust = spread.known_sag * spread.drift_time * e.weight
    out = np.zeros((*e.y.shape, 6 * count))
    for channel, size in enumerate(
        (level, level, thrust, moment, moment, spread.yaw_drift * moment)
    ):
        out[:, channel, channel * count : (channel + 1) * count] = size * hats
    return e.known(out)


LAGS = (0.0, 0.04, 0.08)  # at which motion may answer torque, as rotors do [s]
CHANGE = 0.1  # over which torque changes; own choice: faster than a trim, slower than noise [s]
LEAST_GAIN = 0.02  # so that calibration still has a torque to scale [1]


def torque_gain(flights: Sequence[FlightResiduals]) -> np.ndarray:
    """Return (3,) the share of the rotors' torque about each axis to which the motion of all
    flights responds [1].

    It is the RMS of the change of the motion's torque that lagged rotor torque predicts, over that
    of rotor torque.
    Source: least squares, whose gain is the conditional mean given a noisy regressor, beside
        moments of air and load.
    """
    gain = np.ones(3)
    for axis in range(3):
        X, y = map(np.concatenate, zip(*(_lagged(e, axis) for e in flights), strict=True))
        rms = np.sqrt(np.mean(X[:, 0] ** 2))
        if rms > 0:
            answer = X @ np.linalg.lstsq(X, y, rcond=None)[0]
            gain[axis] = np.clip(np.sqrt(np.mean(answer**2)) / rms, LEAST_GAIN, 1.0)
    return gain


def _lagged(e: FlightResiduals, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Return rotor torque about an axis at all lags (m, k), and the torque of the motion (m,)
    [N·m].

    Both as changes, and without what goes with the changes of velocity, thrust and residual force.
    """
    torque = e.nominal[:, TORQUE][:, axis]
    v_B = e.from_mids(attitude.rotate_back(e.mids.q, e.wrench_states[1][:, V]))
    rows = [round(lag / e.grid.step) for lag in LAGS]
    lagged = [torque[rows[-1] - k : len(torque) - k] for k in rows]
    others = (torque + e.y[:, TORQUE][:, axis], v_B, e.nominal[:, 2], e.y[:, FORCE])
    signals = np.column_stack([*lagged, *(signal[rows[-1] :] for signal in others)])
    apart = max(1, round(CHANGE / e.grid.step))
    change = signals[apart:] - signals[:-apart]
    own, beside = np.split(change, [len(LAGS) + 1], axis=1)
    own = own - beside @ np.linalg.lstsq(beside, own, rcond=None)[0]
    return own[:, :-1], own[:, -1]


def with_torque_gain(flights: Sequence[FlightResiduals], gain: np.ndarray) -> list[FlightResiduals]:
    """Return flights whose motion shows that share of all torque: that of the rotors, and that of
    any effect.

    Args:
        gain: (3,) by `torque_gain` [1].
    """
    found = []
    for e in flights:
        scaled = dc.replace(e, torque_gain=tuple(gain.tolist()))
        y, nominal = e.y.copy(), e.nominal * scaled.shown
        y[:, WRENCH] += e.nominal - nominal
        found.append(dc.replace(scaled, y=e.known(y), nominal=nominal))
    return found


def healthy_spread(
    effect: Effect, e: FlightResiduals, tolerance: Tolerance, *, changed: bool = False
) -> dict[str, tuple[float, float]]:
    """Return the usual value of parameters of an effect, and by how much healthy vehicles differ in
    it; empty where they do not.

    Args:
        changed: since flights before, which is not what a vehicle differs by from its file.
    """
    found = dict[str, tuple[float, float]]()
    stated = [d for d in file_deviations(e.vehicle, tolerance) if d.stated]
    vehicle = [*of_vehicle(e, tolerance), *stated] if not changed else []
    for d in (*vehicle, *(of_flight(e, tolerance) if tolerance.unmeasured else [])):
        if d.is_of(effect) and not d.at_value:
            for p in (p for p in effect.parameters if p.name in d.deviation):
                _, known = found.get(p.name, (0.0, 0.0))
                found[p.name] = d.usual(p), math.hypot(known, d.deviation[p.name])
    if tolerance.unmeasured and isinstance(effect, MassError):
        # Thrust over throttle takes its place.
        for d in (d for d in of_battery(e) if d.effect is ThrustScale):
            found["delta_mass"] = 0.0, d.deviation["scale"] * e.vehicle.mass
    # What is said of some parameters alone does not excuse the others.
    return found if found.keys() >= {p.name for p in effect.parameters if not p.choices} else {}


# half of an interval over the value, above which an exponent is hardly told [1]; own choice
HARDLY = 0.25


def differences(
    fit: Fit, flights: Sequence[FlightResiduals], tolerance: Tolerance
) -> tuple[Difference, ...]:
    """Return what an unmeasured vehicle and its flights differ by, the largest in standard
    deviations first.

    Where the file describes the vehicle that flew: the map of its throttle alone, if that is the
    input.
    """
    found, vehicle, first = [], flights[0].vehicle, len(fit.terms)
    every = tolerance.unmeasured or vehicle.measured
    for k, f in enumerate(fit.free):
        if f.term < first or f.flight:
            continue
        effect, d = fit.calibration[f.term - first].effect, fit.allowed[f.term - first]
        sigma = float(np.sqrt(fit.covariance[k, k]))
        name = f"{d.name}.{f.name}"
        if isinstance(effect, ThrottleCurve):
            found.append(_throttle_map(name, hover_exponent(vehicle), effect.curve, sigma))
        elif every or d.stated:
            value = getattr(effect, f.name) - f.neutral
            p = next(p for p in effect.parameters if p.name == f.name)
            how = (d.effect, p, d.fixed, value, sigma, d.deviation[f.name])
            found.append(_difference(name, *how))
    if not tolerance.unmeasured:
        return tuple(sorted(found, key=lambda d: -d.in_deviations))
    *errors, body, _ = fit.linear
    found += _of_parameters(body, of_vehicle(flights[0], tolerance))
    # What flights differ by, each parameter with its value in every flight and the words of the
    # largest.
    parts = dict(zip((e.name for e in flights), errors, strict=True))
    each: dict[str, dict[str, Difference]] = {}
    for own_e in flights:
        deviations = of_flight(own_e, tolerance)
        for own_d in _of_parameters(parts[own_e.name], deviations):
            each.setdefault(own_d.name, {})[own_e.name] = own_d
    found += map(_largest, each.values())
    return tuple(sorted(found, key=lambda d: -d.in_deviations))


def _throttle_map(name: str, nominal: float, curve: float, sigma: float) -> Difference:
    """Return the power of throttle with which thrust goes, over that of the nominal map."""
    value, half = nominal * (1 + curve), SURE * nominal * sigma
    text = f"thrust goes with the power {number(value, 3)} of throttle"
    if not half < HARDLY * value:
        text = "the power of throttle in thrust is hardly told"
    away = value - nominal
    spread = THROTTLE_CURVE * nominal
    return Difference(name, text, away, "1", spread, (away - half, away + half))


def _of_parameters(part: LinearPart, deviations: Sequence[Deviation]) -> list[Difference]:
    """Return the parameters of deviations; the lags of rotors, which each act by a share, as
    one.
    """
    lags = [d for d in deviations if d.at_value]
    found, k = list[Difference](), 0
    for d in deviations:
        parameters = {p.name: p for p in d.effect.parameters}
        for name, deviation in d.deviation.items():
            if not d.at_value:
                value = part.coefficients[k] * deviation
                sigma = np.sqrt(part.covariance[k, k]) * deviation
                how = (d.effect, parameters[name], d.fixed, value, sigma, deviation)
                found.append(_difference(f"{d.name}.{name}", *how))
            k += 1
    if lags:
        own = slice(k - len(lags), k)
        time = np.array([next(iter(d.deviation.values())) for d in lags])
        value = part.coefficients[own] @ time
        sigma = np.sqrt(time @ part.covariance[own, own] @ time)
        effect, norm = lags[0].effect, float(np.linalg.norm(time))
        found.append(
            _difference(f"{d.name}.{name}", effect, effect.parameters[0], {}, value, sigma, norm)
        )
    return found


def _largest(of: Mapping[str, Difference]) -> Difference:
    name = max(of, key=lambda flight: of[flight].in_deviations)
    values = {flight: d.value for flight, d in of.items()}
    return dc.replace(of[name], text=f"{of[name].text} in {name}", by_flight=values)


def _difference(
    name: str,
    effect: type[Effect],
    p: Parameter,
    fixed: Mapping[str, float],
    value: float,
    sigma: float,
    deviation: float,
) -> Difference:
    """Return a departure from the neutral value in words."""
    unit, text = departure(p, value, fixed, shares=effect.shares)
    ci95 = (float(value - SURE * sigma), float(value + SURE * sigma))
    return Difference(name, text, float(value), unit or "1", float(deviation), ci95)
