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
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.fitting import Fit, LinearPart
from np_drake.diagnosis.forward_model import StageCache, Term, predicted_residual
from np_drake.diagnosis.options import SPREAD, Priors, Spread, Tolerance
from np_drake.diagnosis.regressors import (
    LINEAR,
    PREFIX,
    Candidate,
    calibration,
    calibration_terms,
    generic_candidates,
)
from np_drake.diagnosis.regressors.library import THROTTLE_CURVE
from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals
from np_drake.diagnosis.result import Difference
from np_drake.effects.accelerometer_bias import AccelerometerBias
from np_drake.effects.attitude_bias import AttitudeBias
from np_drake.effects.attitude_latency import AttitudeLatency
from np_drake.effects.base import ActuatorEffect, Effect, MassEffect, Parameter
from np_drake.effects.battery_sag import BatterySag
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.calibration import in_flight
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.imu_mounting import ImuMounting
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.mass_error import MassError
from np_drake.effects.mixer_gain import MixerGain
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.random_sizes import arm
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.throttle_curve import ThrottleCurve
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.effects.translational_lift import TranslationalLift
from np_drake.effects.velocity_bias import VelocityBias
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.files.number_text import departure_unit, measure, number, with_sign
from np_drake.logs.throttle_input import VOLTAGE_SCATTER, hover_exponent, voltage_of
from np_drake.rigid_body import V
from np_drake.vehicle import Vehicle
from np_drake.vehicle.published import published_priors
from np_drake.vehicle.sources import part

ROTORS = (1.0, 2.0, 3.0, 4.0)
SURE = 1.96  # half of a 95 % interval over its standard deviation [1]
LEAST_DEVIATION = 1e-3  # of a stated deviation over that of healthy vehicles [1]


@dc.dataclass(frozen=True)
class Deviation:
    """Standard deviations of parameters of an effect, by name [SI]; `fixed` ones have a value.

    at_value: the deviation is that of a coefficient of the effect at these values, which is not
    linear.
    """

    effect: type[Effect]
    deviation: dict[str, float]
    fixed: dict[str, float] = dc.field(default_factory=dict)
    at_value: bool = False


def of_vehicle(
    e: FlightResiduals, tolerance: Tolerance, spread: Spread = SPREAD
) -> list[Deviation]:
    """Return by what a healthy vehicle differs from its file; nothing where the file describes the
    vehicle that flew.

    Of a number of its calibration for which the file states an interval, the deviation is that of
    the interval.
    """
    if not tolerance.unmeasured:
        return []
    vehicle, measured = e.vehicle, e.measured_rotors
    span, mass = arm(vehicle), vehicle.mass
    moment = spread.flapping * mass * span
    rotor = published_priors().rotor_inertia.median * mass * span**2
    gains = zip(ROTORS, _stated(vehicle, "rotor_gains", [spread.rotor_gain] * 4), strict=True)
    level, height = spread.center_of_mass * span, spread.center_of_mass_height * span
    (rotor,) = _stated(vehicle, "rotor_inertia", [rotor])
    (clock,) = _stated(
        vehicle, "clock_offset", [spread.rotor_speed_time if measured else spread.command_time]
    )
    tilt = _stated(vehicle, "imu_tilt", [spread.mounting] * 3)
    found = [
        *(Deviation(WeakRotor, {"efficiency": gain}, {"rotor": i}) for i, gain in gains),
        Deviation(
            CenterOfMassOffset,
            _by("xyz", _stated(vehicle, "center_of_mass", [level, level, height])),
        ),
        Deviation(MixerGain, dict.fromkeys(("roll", "pitch", "yaw"), spread.torque_gain)),
        Deviation(BladeFlapping, {"moment": moment}),
        Deviation(TranslationalLift, {"lift": spread.lift * mass}),
        Deviation(RotorGyroscopic, {"rotor_inertia": rotor}),
        Deviation(ClockOffset, {"offset": clock}),
    ]
    if "attitude" not in e.log.lacks:
        found += [
            Deviation(ImuMounting, _by(("roll", "pitch", "yaw"), tilt)),
            Deviation(AttitudeLatency, {"latency": spread.latency}),
        ]
    if e.log.a is not None:
        found.append(_axes(AccelerometerBias, spread.accelerometer_offset))
    if not measured:
        (delay,) = _stated(vehicle, "command_delay", [spread.command_time])
        found.append(Deviation(CommandDelay, {"delay": delay}))
        lags = spread.lags if "rotor_time_constant" not in vehicle.intervals else ()
        found += [Deviation(MotorLag, {"time_constant": lag}, at_value=True) for lag in lags]
    return found


def _stated(vehicle: Vehicle, field: str, healthy: list[float]) -> list[float]:
    """Return the standard deviations of the numbers of a field of the calibration: as stated, else
    of healthy ones.
    """
    name, said = f"calibration.{field}", vehicle.intervals
    every = [said.get(part(name, i)) or said.get(name, [])[i : i + 1] for i in range(len(healthy))]
    halves = ([0.5 * (high - low) for low, high in pairs] for pairs in every)
    return [
        max(*half, LEAST_DEVIATION * usual) / SURE if half else usual
        for half, usual in zip(halves, healthy, strict=True)
    ]


def calibrated_alone(e: FlightResiduals, tolerance: Tolerance) -> set[str]:
    """Return the effects that are calibration whatever their size, and causes only where they begin
    in flight.

    A mass, where the scale of a throttle's map takes its place; of an unmeasured vehicle sensors,
    torque gains, inertia and times of commands.
    """
    mass = {MassError.identifier} if e.log.input == "normalised" else set[str]()
    if not tolerance.unmeasured:
        return mass
    every = [*of_vehicle(e, tolerance), *of_flight(e, tolerance)]
    # Of inertia and the share of torque that acts a flight shows the ratio alone.
    return (
        mass
        | {InertiaError.identifier}
        | {
            d.effect.identifier
            for d in every
            if d.effect.place == "measurement"
            or d.effect.role == "mixer"
            or d.effect.shifts_commands
        }
    )


def of_flight(e: FlightResiduals, tolerance: Tolerance, spread: Spread = SPREAD) -> list[Deviation]:
    """Return by what a flight differs from the others of its vehicle: sensors, and for an
    unmeasured vehicle trim.
    """
    least = (
        spread
        if tolerance.unmeasured
        else Spread(tilt=0.0, gyro=0.0, velocity=0.0, accelerometer=0.0)
    )
    tilt = max(tolerance.attitude, least.tilt)
    found = [
        *(
            []
            if e.log.a is None
            else [_axes(AccelerometerBias, max(tolerance.acceleration, least.accelerometer))]
        ),
        Deviation(AttitudeBias, dict.fromkeys(("roll", "pitch", "yaw"), tilt)),
        _axes(GyroBias, max(tolerance.rate, least.gyro)),
        _axes(VelocityBias, max(tolerance.velocity, least.velocity)),
    ]
    if not tolerance.unmeasured:
        return [*found, *of_battery(e, spread)]
    return [
        *found,
        *(Deviation(WeakRotor, {"efficiency": spread.rotor_trim}, {"rotor": i}) for i in ROTORS),
        *(of_battery(e, spread) or _battery(spread.known_charge, spread.known_sag)),
    ]


def of_battery(e: FlightResiduals, spread: Spread = SPREAD) -> list[Deviation]:
    """Return by what thrust over throttle differs from that of other flights, as the battery does;
    else nothing.
    """
    if e.log.input != "normalised":
        return []
    volts = voltage_of(e.log)
    if volts is None:
        return _battery(spread.unknown_charge, spread.sag)
    # The power of a voltage that falls is known to a third: thrust falls by so much more or less.
    fall = VOLTAGE_SCATTER * float(np.ptp(np.log(volts))) / float(np.ptp(e.log.t))
    return _battery(spread.charge, float(np.hypot(spread.known_sag, fall)))


def _battery(charge: float, sag: float) -> list[Deviation]:
    return [Deviation(ThrustScale, {"scale": charge}), Deviation(BatterySag, {"rate": sag})]


def _axes(effect: type[Effect], deviation: float) -> Deviation:
    return Deviation(effect, dict.fromkeys("xyz", deviation))


def _by(names: Iterable[str], deviations: list[float]) -> dict[str, float]:
    return dict(zip(names, deviations, strict=True))


def parameter_names(deviations: list[Deviation]) -> list[str]:
    """Return the names of all parameters of deviations, as `weak_rotor[2].efficiency`."""
    return [f"{_name(d)}.{name}" for d in deviations for name in d.deviation]


def _name(d: Deviation) -> str:
    fixed = "".join(f"[{value:g}]" for value in d.fixed.values())
    return f"{d.effect.identifier}{fixed}"


def sizes(deviations: list[Deviation]) -> np.ndarray:
    """Return the standard deviations (k,) of all parameters of deviations [SI]."""
    return np.array([size for d in deviations for size in d.deviation.values()])


# Smooth functions of velocity, attitude rate and thrust: what an airframe has and no effect of the
# library describes.
SMOOTH = ("rates", "side force", "velocity", "cross flow", "thrust curve", "command")
FLATTEST = 0.98  # of the sum of two moments of inertia that the third may reach [1]
PART = 0.2  # of a deviation at which a mass effect is differenced, as it is not quite linear [1]


def columns_of(e: FlightResiduals, deviations: Sequence[Deviation]) -> np.ndarray:
    """Return columns (m, 15, k) of all parameters of deviations, of one standard deviation each."""
    stages, out = StageCache(), []
    for d in deviations:
        parameters = {p.name: p for p in d.effect.parameters}
        neutral = {name: p.neutral for name, p in parameters.items() if not p.choices} | d.fixed
        for name, deviation in d.deviation.items():
            p = parameters[name]
            step = deviation * (PART if d.effect.place == "mass" else 1.0)
            step = step if p.neutral + step <= p.upper else -step
            effect = d.effect.of({**neutral, name: p.neutral + step})
            out.append(predicted_residual(e, [Term(effect)], stages) * (deviation / step))
    return np.stack(out, axis=-1) if out else np.zeros((*e.y.shape, 0))


def nuisance_of(
    flights: Sequence[FlightResiduals], tolerance: Tolerance, priors: Priors
) -> list[Candidate]:
    """Return all that every model holds, as columns with prior N(0, 1)."""
    return [*calibration(flights, tolerance), *calibration_columns(flights, tolerance, priors)]


def calibration_columns(
    flights: Sequence[FlightResiduals], tolerance: Tolerance, priors: Priors
) -> list[Candidate]:
    """Return what flights differ by, and what an unmeasured vehicle and its airframe differ by from
    the file.
    """
    errors = flight_errors(flights, tolerance)
    return [
        *errors,
        *(
            Candidate((), LINEAR, {e.name: of(e) for e in flights}, lambda c: [], generic=of)
            for of in vehicle_columns(flights, tolerance, priors)
        ),
    ]


def vehicle_columns(
    flights: Sequence[FlightResiduals], tolerance: Tolerance, priors: Priors
) -> list[Callable[[FlightResiduals], np.ndarray]]:
    """Return functions that give the columns (m, 15, k) of any flight for what the vehicle and its
    airframe differ by.
    """
    shared = of_vehicle(flights[0], tolerance)
    if not shared:
        return []
    groups = [
        c
        for c in generic_candidates(flights, priors)
        if c.identifiers[0].removeprefix(PREFIX) in SMOOTH
    ]

    # A force in proportion to the velocity along the same axis is linear drag, an effect; unless it
    # does not grow with rotor speed as that does.
    drags = [np.zeros(c.size, bool) for c in groups]
    for c, own in zip(groups, drags, strict=True):
        if c.identifiers == (f"{PREFIX}velocity",):
            own[[7 * axis for axis in range(3)]] = True
    own_axis = np.concatenate(drags)
    # Beyond the usual motion a function of it stays within its prior, so that it does not grow with
    # speed cubed.
    weight, span = flights[0].weight, arm(flights[0].vehicle)
    usual = (
        priors.generic_size * weight * np.array([1.0, 1.0, 1.0, 0.3 * span, 0.3 * span, 0.1 * span])
    )
    flown = np.concatenate([_smooth(groups, e)[:, WRENCH] for e in flights]) / usual[:, None]
    most = np.maximum(1.0, np.sqrt(np.mean(np.sum(flown**2, axis=1), axis=0)))

    def of_body(e: FlightResiduals) -> np.ndarray:
        return columns_of(e, shared)

    def of_air(e: FlightResiduals) -> np.ndarray:
        columns = _smooth(groups, e) / most
        slower = 1.0 - np.sqrt(np.maximum(e.nominal[:, 2], 0.0) / e.weight)
        columns[..., own_axis] *= slower[:, None, None]
        return np.concatenate([columns, thrust_axis_columns(e)], axis=-1)

    return [of_body, of_air]


def thrust_axis_columns(e: FlightResiduals, spread: Spread = SPREAD) -> np.ndarray:
    """Return columns (m, 15, 2) of thrust that leans to x and y in the axes of the
    accelerometer.
    """
    out = np.zeros((*e.y.shape, 2))
    out[:, 0, 0] = out[:, 1, 1] = spread.mounting * e.nominal[:, 2]
    return out


def _smooth(groups: Sequence[Candidate], e: FlightResiduals) -> np.ndarray:
    """Return the columns (m, 15, k) of groups of generic structure on a flight."""
    return np.concatenate([c.generic(e) for c in groups if c.generic], axis=-1)


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
    found: list[Effect] = [
        t.effect for t in fit.calibration if isinstance(t.effect, ActuatorEffect | MassEffect)
    ]
    if not fit.calibrated:
        return found
    # A share of all torque is shown as if the inertia were larger, by as much as a rigid body can
    # have it.
    moments = e.vehicle.J.diagonal() / e.torque_gain
    moments = np.minimum(moments, FLATTEST * (moments.sum() - moments))
    found.append(InertiaError(*(moments / e.vehicle.J.diagonal())))
    coefficients, first = fit.calibrated[0][1], 0
    for d in of_vehicle(e, tolerance):
        own = coefficients[first : first + len(d.deviation)]
        first += len(d.deviation)
        if d.at_value or d.effect.place == "measurement" or d.effect.shifts_commands:
            continue
        parameters = {p.name: p for p in d.effect.parameters}
        values = {name: p.neutral for name, p in parameters.items() if not p.choices} | d.fixed
        for (name, deviation), c in zip(d.deviation.items(), own, strict=True):
            p = parameters[name]
            values[name] = float(np.clip(p.neutral + c * deviation, p.lower, p.upper))
        found.append(d.effect.of(values))
    return found


def flight_errors(flights: Sequence[FlightResiduals], tolerance: Tolerance) -> list[Candidate]:
    """Return what every flight differs by, a candidate a flight; none for ideal sensors."""
    if not tolerance.real:
        return []
    found = []
    for e in flights:
        own = errors_of(e, tolerance)
        nothing = {
            other.name: np.broadcast_to(0.0, (*other.y.shape, own.shape[-1])) for other in flights
        }
        found.append(Candidate((), LINEAR, {**nothing, e.name: own}, lambda c: []))
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
    thrust = (
        spread.known_sag * spread.drift_time * e.weight
    )  # as much as a battery sags from knot to knot
    size = (level, level, thrust, moment, moment, spread.yaw_drift * moment)
    out = np.zeros((*e.y.shape, 6 * count))
    for channel in range(6):
        out[:, channel, channel * count : (channel + 1) * count] = size[channel] * hats
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
        given, shown = zip(*(_lagged(e, axis) for e in flights), strict=True)
        X, y = np.concatenate(given), np.concatenate(shown)
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


AXES = 2  # last columns of the airframe: thrust that leans to x and y
# half of an interval over the value, above which an exponent is hardly told [1]; own choice
HARDLY = 0.25


def differences(
    fit: Fit, flights: Sequence[FlightResiduals], tolerance: Tolerance
) -> tuple[Difference, ...]:
    """Return what an unmeasured vehicle and its flights differ by, the largest in standard
    deviations first.
    Returns: where the file describes the vehicle that flew, the map of its throttle alone, if that
        is the input.
    """
    of_throttle = _throttle_map(fit, flights[0])
    if not tolerance.unmeasured:
        return tuple(of_throttle)
    *errors, body, air = fit.linear
    found = [
        *of_throttle,
        *_of_file(fit, flights[0], tolerance),
        *_of_parameters(body, of_vehicle(flights[0], tolerance), flights[0].torque_share),
        *_of_airframe(air, flights),
        *_of_flights(dict(zip((e.name for e in flights), errors, strict=True)), flights, tolerance),
    ]
    return tuple(sorted(found, key=lambda d: -d.in_deviations))


def _of_file(fit: Fit, e: FlightResiduals, tolerance: Tolerance) -> Iterator[Difference]:
    """Yield errors of mass, thrust and input within the tolerance of the file."""
    priors = calibration_terms(e.vehicle, tolerance)
    for i, (term, (_, deviation)) in enumerate(zip(fit.calibration, priors, strict=True)):
        for p in term.effect.parameters:
            if isinstance(term.effect, ThrottleCurve):
                continue
            sigma = _deviation_of(fit, i, p.name)
            value = getattr(term.effect, p.name) - p.neutral
            yield _difference(
                f"{term.effect.identifier}.{p.name}",
                type(term.effect),
                p,
                {},
                value,
                sigma,
                deviation,
            )


def _deviation_of(fit: Fit, i: int, name: str) -> float:
    """Return the standard deviation of a parameter of calibration term i; NaN where it is fixed."""
    own = [k for k, f in enumerate(fit.free) if (f.term, f.name) == (len(fit.terms) + i, name)]
    return float(np.sqrt(fit.covariance[own[0], own[0]])) if own else np.nan


def _throttle_map(fit: Fit, e: FlightResiduals) -> list[Difference]:
    """Return the power of throttle with which thrust goes, over that of the nominal map; none of
    another input.
    """
    found = []
    for i, term in enumerate(fit.calibration):
        if isinstance(term.effect, ThrottleCurve):
            nominal = hover_exponent(e.vehicle)
            value, half = (
                nominal * (1 + term.effect.curve),
                SURE * nominal * _deviation_of(fit, i, "curve"),
            )
            told = f"thrust goes with the power {number(value, 3)} of throttle"
            text = (
                told if half < HARDLY * value else "the power of throttle in thrust is hardly told"
            )
            ci95 = (value - nominal - half, value - nominal + half)
            found.append(
                Difference(
                    "throttle_curve.curve",
                    text,
                    value - nominal,
                    "1",
                    THROTTLE_CURVE * nominal,
                    ci95,
                )
            )
    return found


def _of_parameters(
    part: LinearPart,
    deviations: Sequence[Deviation],
    share: Mapping[str, float] = MappingProxyType({}),
) -> list[Difference]:
    """Return the parameters of deviations; the lags of rotors, which each act by a share, as
    one.
    """
    lags = [d for d in deviations if d.at_value]
    names, found, k = parameter_names(list(deviations)), [], 0
    for d in deviations:
        parameters = {p.name: p for p in d.effect.parameters}
        for name, deviation in d.deviation.items():
            if not d.at_value:
                value, sigma = (
                    part.coefficients[k] * deviation,
                    np.sqrt(part.covariance[k, k]) * deviation,
                )
                if d.effect is MixerGain:  # of the share of torque that the motion shows
                    value, sigma = share[name] * (1.0 + value) - 1.0, share[name] * sigma
                found.append(
                    _difference(
                        names[k], d.effect, parameters[name], d.fixed, value, sigma, deviation
                    )
                )
            k += 1
    if lags:
        own = slice(k - len(lags), k)
        time = np.array([next(iter(d.deviation.values())) for d in lags])
        value, sigma = (
            part.coefficients[own] @ time,
            np.sqrt(time @ part.covariance[own, own] @ time),
        )
        effect, norm = lags[0].effect, float(np.linalg.norm(time))
        found.append(_difference(names[-1], effect, effect.parameters[0], {}, value, sigma, norm))
    return found


def _of_airframe(part: LinearPart, flights: Sequence[FlightResiduals]) -> list[Difference]:
    """Return how thrust leans, and the RMS of what goes smoothly with velocity, body rate and
    thrust.
    """
    assert part.columns is not None
    found = []
    for k, (more, less) in enumerate(
        (("ahead", "back"), ("to the left", "to the right")), start=-AXES
    ):
        value, sigma = (
            SPREAD.mounting * v for v in (part.coefficients[k], np.sqrt(part.covariance[k, k]))
        )
        p = Parameter(
            "xy"[k],
            "rad",
            0.0,
            -1.0,
            1.0,
            1.0,
            departure=f"thrust leans {{size}} {more}|thrust leans {{size}} {less}",
        )
        found.append(
            _difference(f"thrust_axis.{p.name}", Effect, p, {}, value, sigma, SPREAD.mounting)
        )
    columns = np.concatenate([part.columns(e)[..., :-AXES] for e in flights])
    text = "airframe: {kind} of {size} RMS that goes with velocity, body rate and thrust"
    return [
        *found,
        *_root_mean_square("airframe", text, {"": (columns, part.coefficients[:-AXES])}),
    ]


def _of_flights(
    parts: Mapping[str, LinearPart], flights: Sequence[FlightResiduals], tolerance: Tolerance
) -> list[Difference]:
    """Return what flights differ by, each parameter with its value in every flight and the words of
    the largest.
    """
    each: dict[str, dict[str, Difference]] = {}
    drift = {}
    for e in flights:
        deviations = of_flight(e, tolerance)
        for d in _of_parameters(parts[e.name], deviations):
            each.setdefault(d.name, {})[e.name] = d
        columns = drift_columns(e)
        drift[e.name] = columns, parts[e.name].coefficients[-columns.shape[-1] :]
    return [
        *map(_largest, each.values()),
        *_root_mean_square("drift", "{kind} that drifts by {size} RMS", drift),
    ]


def _largest(of: Mapping[str, Difference]) -> Difference:
    name = max(of, key=lambda flight: of[flight].in_deviations)
    values = {flight: d.value for flight, d in of.items()}
    return dc.replace(of[name], text=f"{of[name].text} in {name}", by_flight=values)


def _root_mean_square(
    name: str, text: str, parts: Mapping[str, tuple[np.ndarray, np.ndarray]]
) -> list[Difference]:
    """Return the RMS force and torque of columns with their coefficients, and what it is under
    their prior.
    """
    found = []
    for kind, channels, unit in (("force", FORCE, "N"), ("torque", TORQUE, "N·m")):
        of = {}
        for flight, (columns, coefficients) in parts.items():
            X = columns[:, channels]
            value = float(np.sqrt(np.mean(np.sum((X @ coefficients) ** 2, axis=1))))
            deviation = float(np.sqrt(np.mean(np.sum(X**2, axis=(1, 2)))))
            said = text.format(kind=kind, size=measure(value, unit))
            of[flight] = Difference(f"{name}.{kind}", said, value, unit, deviation)
        found.append(_largest(of) if "" not in of else of[""])
    return found


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
    unit = "share" if p.unit == "1" and effect.shares else p.unit
    more, _, less = p.departure.partition("|")
    factor, shown = departure_unit(unit)
    size = measure(factor * abs(value), shown)
    words = less if less and value < 0 else more
    text = words.format(
        size=size, signed=with_sign(size, value), **{n: f"{v:g}" for n, v in fixed.items()}
    )
    ci95 = (float(value - SURE * sigma), float(value + SURE * sigma))
    return Difference(name, text, float(value), unit or "1", float(deviation), ci95)
