"""Calibration: what healthy vehicles differ by from their file, and flights from one another.

It is part of every model and no cause: columns of the regression in units of documented standard
deviations. Lengths count in mean arms, moments in weight times arm.
The share of the rotors' torque to which the motion responds comes before everything else:
controllers run faster than logs, and of logged torque the motion may show a small part.
J dw/dt = gain (torque of rotors and effects) holds for both. Torque that trims a moment of the air
or of a payload does not count: effects explain it.
"""

import dataclasses as dc
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.effect_prior import (
    ROTOR_NUMBERS,
    EffectPrior,
    airframe_priors,
    columns_of,
    file_priors,
)
from np_drake.diagnosis.fitting import Fit, LinearPart
from np_drake.diagnosis.forward_model import Term, once, predicted_residual
from np_drake.diagnosis.options import HALF_WIDTH_95, Priors, Tolerance
from np_drake.diagnosis.regressors import LINEAR, PREFIX, Candidate, generic_candidates
from np_drake.diagnosis.regressors.generic import VELOCITY_COLUMNS
from np_drake.diagnosis.regressors.library_regressors import THROTTLE_CURVE
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
from np_drake.effects.library import CHANGES
from np_drake.estimation.priors import FREEDOM, HEALTHY, stated
from np_drake.files.number_text import number
from np_drake.logs.importing.signals import Signal
from np_drake.logs.inputs import hover_exponent, voltage_of
from np_drake.logs.rotors import named_rotors
from np_drake.rigid_body import V
from np_drake.vehicle.published import published_priors
from np_drake.vehicle.rotor_layout import RotorName
from np_drake.vehicle.vehicle import VOLTAGE_SCATTER, PowerMap

AXES = ("roll", "pitch", "yaw")
BATTERY = (ThrustScale, BatterySag)
SENSORS = (AccelerometerBias, AttitudeBias, GyroBias, VelocityBias)
LEANING = 2  # last columns of the airframe: thrust that leans to x and y


def of_vehicle(flight: FlightResiduals, tolerance: Tolerance) -> list[EffectPrior]:
    """Return by what a healthy vehicle differs from its file; nothing where that which flew was
    measured.

    Of a number for which the file states an interval, the deviation is that of the interval, but
    not less than 1e-3 of that of healthy vehicles.
    """
    vehicle = flight.vehicle
    span = arm(flight.vehicle)
    mass = flight.vehicle.mass
    if not tolerance.unmeasured:
        return []

    known = partial(stated, vehicle)
    clock = HEALTHY.rotor_speed_time if flight.measured_rotors else HEALTHY.command_time
    rotor_inertia = published_priors().rotor_inertia.median * mass * span**2
    effect_priors = [
        *airframe_priors(vehicle, unmeasured=True),
        # It has all that moments of inertia do but the gyroscopic torque.
        EffectPrior(MixerGain, dict.fromkeys(AXES, HEALTHY.torque_gain)),
        EffectPrior(BladeFlapping, {"moment": HEALTHY.flapping * mass * span}),
        EffectPrior(TranslationalLift, {"lift": HEALTHY.lift * mass}),
        EffectPrior(
            RotorGyroscopic, {"rotor_inertia": known("calibration.rotor_inertia", rotor_inertia)}
        ),
        EffectPrior(ClockOffset, {"offset": known("calibration.clock_offset", clock)}),
    ]
    if "attitude" not in flight.log.lacks:
        tilt = {
            axis: known("calibration.imu_tilt", HEALTHY.mounting, i) for i, axis in enumerate(AXES)
        }
        effect_priors += [
            EffectPrior(ImuMounting, tilt),
            EffectPrior(AttitudeLatency, {"latency": HEALTHY.latency}),
        ]
    if flight.log.a is not None:
        effect_priors.append(
            EffectPrior(AccelerometerBias, dict.fromkeys("xyz", HEALTHY.accelerometer_offset))
        )
    if not flight.measured_rotors:
        effect_priors.append(
            EffectPrior(
                CommandDelay, {"delay": known("calibration.command_delay", HEALTHY.command_time)}
            )
        )
        lags = HEALTHY.lags if "rotor_time_constant" not in vehicle.intervals else ()
        effect_priors += [
            EffectPrior(MotorLag, {"time_constant": lag}, at_value=True) for lag in lags
        ]
    return effect_priors


def calibrated_alone(flight: FlightResiduals, tolerance: Tolerance) -> set[str]:
    """Return the effects that are calibration whatever their size, and causes only where they begin
    in flight or since flights before.

    What propellers are like; mass and thrust, where the scale of a throttle's map takes their
    place; of an unmeasured vehicle sensors, torque gains, inertia and times of commands.
    """
    alone = set(CHANGES.values())
    if flight.log.input == "normalised":
        alone |= {MassError, ThrustScale}
    if tolerance.unmeasured:
        effects = [
            d.effect for d in (*of_vehicle(flight, tolerance), *of_flight(flight, tolerance))
        ]
        sensors = [f for f in effects if f.place == "measurement" or f.role == "mixer"]
        # Of inertia and the share of torque that acts a flight shows the ratio alone.
        alone |= {*sensors, *(f for f in effects if f.shifts_commands), InertiaError}
    return {effect.identifier for effect in alone}


def of_flight(flight: FlightResiduals, tolerance: Tolerance) -> list[EffectPrior]:
    """Return by what a flight differs from the others of its vehicle: sensors, and for an
    unmeasured vehicle trim.
    """
    usual = (HEALTHY.accelerometer, HEALTHY.tilt, HEALTHY.gyro, HEALTHY.velocity)
    effect_priors = []
    for effect, least in zip(SENSORS, usual, strict=True):
        error = max(tolerance.of(effect), least * tolerance.unmeasured)
        if effect is not AccelerometerBias or flight.log.a is not None:
            effect_priors.append(EffectPrior(effect, {p.name: error for p in effect.parameters}))
    if not tolerance.unmeasured:
        return [*effect_priors, *of_battery(flight)]
    effect_priors += [
        EffectPrior(WeakRotor, {"efficiency": HEALTHY.rotor_trim}, {"rotor": i})
        for i in ROTOR_NUMBERS
    ]
    if flight.earlier:
        # How much of the torque the motion hides goes with noise and liveliness of the flight: a
        # change since is told by what it shows.
        hidden = {axis: 1.0 - gain for axis, gain in zip(AXES, flight.torque_gain, strict=True)}
        share = {axis: HEALTHY.torque_share * part for axis, part in hidden.items() if part > 0}
        effect_priors += [EffectPrior(MixerGain, share)] if share else []
    return effect_priors + (
        of_battery(flight)
        or [
            EffectPrior(BATTERY[0], {"scale": HEALTHY.known_charge}),
            EffectPrior(BATTERY[1], {"rate": HEALTHY.known_sag}),
        ]
    )


def of_battery(flight: FlightResiduals) -> list[EffectPrior]:
    """Return by what thrust over throttle differs from that of other flights, as the battery does;
    else nothing.
    """
    if flight.log.input != "normalised":
        return []
    volts = voltage_of(flight.log)
    charge = HEALTHY.unknown_charge
    sag = HEALTHY.sag
    known = flight.log.throttle_map
    away = 0.0
    if volts is not None and not (isinstance(known, PowerMap) and known.volts is None):
        # The power of a voltage that falls is known to a third: thrust falls by so much more or
        # less. So it does with another battery.
        fall = VOLTAGE_SCATTER * float(np.ptp(np.log(volts))) / float(np.ptp(flight.log.t))
        usual = known.volts if isinstance(known, PowerMap) else float(np.median(volts))
        away = VOLTAGE_SCATTER * float(np.log(np.median(volts) / usual))
        charge = HEALTHY.charge
        sag = float(np.hypot(HEALTHY.known_sag, fall))
    if isinstance(known, PowerMap):
        # Flights that agree tell that thrust over throttle scatters less: inverse gamma.
        squares = FREEDOM * charge**2 + known.scatter
        charge = float(np.sqrt(squares / (FREEDOM + known.freedom)))
    return [
        EffectPrior(BATTERY[0], {"scale": float(np.hypot(charge, away))}),
        EffectPrior(BATTERY[1], {"rate": sag}),
    ]


# Smooth functions of velocity, attitude rate and thrust: what an airframe has and no effect of the
# library describes.
SMOOTH = ("rates", "side force", "velocity", "cross flow", "thrust curve", "command")
LARGEST_MOMENT = 0.98  # of the sum of two moments of inertia that the third may reach [1]


def nuisance_of(
    flights: Sequence[FlightResiduals], tolerance: Tolerance, priors: Priors
) -> list[Candidate]:
    """Return all that every model holds, as columns with prior N(0, 1): errors of the file, what
    flights differ by, and what an unmeasured vehicle and its airframe differ by from the file.
    """
    vehicle = [
        Candidate(
            (),
            LINEAR,
            {flight.name: once(flight.made, (), of, flight) for flight in flights},
            lambda c: [],
            generic=of,
        )
        for of in vehicle_columns(flights, tolerance, priors)
    ]
    return [*file_errors(flights, tolerance), *flight_errors(flights, tolerance), *vehicle]


def vehicle_columns(
    flights: Sequence[FlightResiduals], tolerance: Tolerance, priors: Priors
) -> list[Callable[[FlightResiduals], np.ndarray]]:
    """Return functions that give the columns (m, 15, k) of any flight for what a session differs by
    from flights before, and what the vehicle and its airframe differ by; the last two are thrust
    that leans to x and y in the axes of the accelerometer.
    """
    since = tolerance.reseated and any(flight.earlier for flight in flights)
    session: list[Callable[[FlightResiduals], np.ndarray]] = [of_session] if since else []
    shared = of_vehicle(flights[0], tolerance)
    if not shared:
        return session
    names = {f"{PREFIX}{name}" for name in SMOOTH}
    groups = [c for c in generic_candidates(flights, priors) if c.identifiers[0] in names]

    # A force in proportion to the velocity along the same axis is linear drag, an effect; unless it
    # does not grow with rotor speed as that does.
    velocity = (f"{PREFIX}velocity",)
    first = np.cumsum([0] + [c.size for c in groups])
    own_axis = [
        first[k] + axis * VELOCITY_COLUMNS + axis
        for k, c in enumerate(groups)
        if c.identifiers == velocity
        for axis in range(3)
    ]

    def smooth(flight: FlightResiduals) -> np.ndarray:
        return np.concatenate([c.generic(flight) for c in groups if c.generic], axis=-1)

    # Beyond the usual motion a function of it stays within its prior, so that it does not grow with
    # speed cubed.
    span = arm(flights[0].vehicle)
    axes = np.array([1.0, 1.0, 1.0, 0.3 * span, 0.3 * span, 0.1 * span])
    usual = priors.generic_size * flights[0].weight * axes
    flown = np.concatenate([smooth(flight)[:, WRENCH] for flight in flights]) / usual[:, None]
    most = np.maximum(1.0, np.sqrt(np.mean(np.sum(flown**2, axis=1), axis=0)))

    def of_air(flight: FlightResiduals) -> np.ndarray:
        columns = smooth(flight) / most
        leaning = np.zeros((*flight.y.shape, LEANING))
        slower = 1.0 - np.sqrt(np.maximum(flight.nominal[:, 2], 0.0) / flight.weight)
        columns[..., own_axis] *= slower[:, None, None]
        leaning[:, 0, 0] = leaning[:, 1, 1] = HEALTHY.mounting * flight.nominal[:, 2]
        return np.concatenate([columns, leaning], axis=-1)

    return [*session, partial(columns_of, effect_priors=shared), of_air]


def of_session(flight: FlightResiduals) -> np.ndarray:
    """Return columns (m, 15, k) of what a battery that was taken out and put in again changes since
    flights before.
    """
    shift = HEALTHY.session_shift * arm(flight.vehicle)
    effect_priors = [
        EffectPrior(CenterOfMassOffset, {"x": shift, "y": shift}),
        EffectPrior(ThrustScale, {"scale": HEALTHY.session_thrust}),
    ]
    return columns_of(flight, effect_priors) * (not flight.earlier)


def subtract_file_calibration(flight: FlightResiduals) -> FlightResiduals:
    """Return the flight against the vehicle with the calibration of its file: its part that is not
    in the rotors.
    """
    fixed = tuple(e for e in in_flight(flight.vehicle) if not isinstance(e, ActuatorEffect))
    given = predicted_residual(flight, [Term(effect) for effect in fixed])
    wrench = given[:, WRENCH]
    y = flight.known(flight.y - given)
    return dc.replace(flight, y=y, nominal=flight.nominal + wrench, fixed=fixed, given=wrench)


def calibration_effects(fit: Fit, flight: FlightResiduals, tolerance: Tolerance) -> list[Effect]:
    """Return the effects of the vehicle's calibration, without those of sensors, for a
    simulator.
    """
    effects: list[Effect] = [
        t.effect for t in fit.calibration if not isinstance(t.effect, SensorEffect)
    ]
    if not fit.calibrated:
        return effects
    # A share of all torque is shown as if the inertia were larger.
    moments = flight.vehicle.J.diagonal() / flight.torque_gain
    coefficients = iter(fit.calibrated[0][1])
    for d in of_vehicle(flight, tolerance):
        moved = {name: c * sd for (name, sd), c in zip(d.sigma.items(), coefficients, strict=False)}
        if d.at_value or d.effect.place == "measurement" or d.effect.shifts_commands:
            continue
        parameters = [p for p in d.effect.parameters if p.name in moved]
        values = [np.clip(p.neutral + moved[p.name], p.lower, p.upper) for p in parameters]
        if d.effect is InertiaError:
            moments *= values
        else:
            effects.append(
                d.at(**{p.name: float(v) for p, v in zip(parameters, values, strict=True)})
            )
    # No larger than a rigid body can have it.
    moments = np.minimum(moments, LARGEST_MOMENT * (moments.sum() - moments))
    return [*effects, InertiaError(*(moments / flight.vehicle.J.diagonal()))]


def file_errors(flights: Sequence[FlightResiduals], tolerance: Tolerance) -> list[Candidate]:
    """Return what every vehicle may differ by from its file, a candidate an effect."""
    return [
        Candidate(
            (),
            "calibration",
            {flight.name: columns_of(flight, [d], part=1.0) for flight in flights},
            lambda c: [],
        )
        for d in file_priors(flights[0].vehicle, tolerance)
    ]


def flight_errors(flights: Sequence[FlightResiduals], tolerance: Tolerance) -> list[Candidate]:
    """Return what every flight differs by, a candidate a flight; none for ideal sensors."""
    candidates = []
    for flight in flights if tolerance.real else ():
        errors = errors_of(flight, tolerance)
        columns = {o.name: np.broadcast_to(0.0, (*o.y.shape, errors.shape[-1])) for o in flights}
        candidates.append(Candidate((), LINEAR, {**columns, flight.name: errors}, lambda c: []))
    return candidates


def errors_of(flight: FlightResiduals, tolerance: Tolerance) -> np.ndarray:
    """Return columns (m, 15, k) of what a flight differs by from others of its vehicle."""
    return once(flight.made, (tolerance,), _errors_of, flight, tolerance)


def _errors_of(flight: FlightResiduals, tolerance: Tolerance) -> np.ndarray:
    constant = columns_of(flight, of_flight(flight, tolerance))
    return np.concatenate(
        [constant, *([drift_columns(flight)] if tolerance.unmeasured else [])], axis=-1
    )


def drift_columns(flight: FlightResiduals) -> np.ndarray:
    """Return columns (m, 15, 6 k) of slow changes of each channel of the wrench: hats between k
    knots.

    Attitude and gyro drift, a battery sags and warms, trim changes: slower than the noise model
    remembers.
    """
    count = max(2, round((flight.t[-1] - flight.t[0]) / HEALTHY.drift_time) + 1)
    hats = Signal(np.linspace(flight.t[0], flight.t[-1], count), np.eye(count)).linear(flight.t)
    moment = HEALTHY.torque_drift * flight.weight * arm(flight.vehicle)
    level = HEALTHY.tilt_drift * flight.weight
    # As much as a battery sags from knot to knot.
    thrust = HEALTHY.known_sag * HEALTHY.drift_time * flight.weight
    out = np.zeros((*flight.y.shape, 6 * count))
    for channel, size in enumerate(
        (level, level, thrust, moment, moment, HEALTHY.yaw_drift * moment)
    ):
        out[:, channel, channel * count : (channel + 1) * count] = size * hats
    return flight.known(out)


LAGS = (0.0, 0.04, 0.08)  # at which motion may answer torque, as rotors do [s]
CHANGE = 0.1  # over which torque changes; own choice: faster than a trim, slower than noise [s]
LEAST_TORQUE_GAIN = 0.02  # so that calibration still has a torque to scale [1]


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
        X, y = map(np.concatenate, zip(*(_lagged(flight, axis) for flight in flights), strict=True))
        rms = np.sqrt(np.mean(X[:, 0] ** 2))
        if rms > 0:
            answer = X @ np.linalg.lstsq(X, y, rcond=None)[0]
            gain[axis] = np.clip(np.sqrt(np.mean(answer**2)) / rms, LEAST_TORQUE_GAIN, 1.0)
    return gain


def _lagged(flight: FlightResiduals, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Return rotor torque about an axis at all lags (m, k), and the torque of the motion (m,)
    [N·m].

    Both as changes, and without what goes with the changes of velocity, thrust and residual force.
    """
    torque = flight.nominal[:, TORQUE][:, axis]
    v_B = flight.from_mids(attitude.rotate_back(flight.mids.q, flight.wrench_states[1][:, V]))
    rows = [round(lag / flight.grid.step) for lag in LAGS]
    lagged = [torque[rows[-1] - k : len(torque) - k] for k in rows]
    others = (torque + flight.y[:, TORQUE][:, axis], v_B, flight.nominal[:, 2], flight.y[:, FORCE])
    signals = np.column_stack([*lagged, *(signal[rows[-1] :] for signal in others)])
    apart = max(1, round(CHANGE / flight.grid.step))
    torques, nuisance = np.split(signals[apart:] - signals[:-apart], [len(LAGS) + 1], axis=1)
    torques = torques - nuisance @ np.linalg.lstsq(nuisance, torques, rcond=None)[0]
    return torques[:, :-1], torques[:, -1]


def scale_torque(flights: Sequence[FlightResiduals], gain: np.ndarray) -> list[FlightResiduals]:
    """Return flights whose motion shows that share of all torque: that of the rotors, and that of
    any effect.

    Args:
        gain: (3,) by `torque_gain` [1].
    """
    scaled_flights = []
    for flight in flights:
        scaled = dc.replace(flight, torque_gain=tuple(gain.tolist()))
        y = flight.y.copy()
        nominal = flight.nominal * scaled.shown
        y[:, WRENCH] += flight.nominal - nominal
        scaled_flights.append(dc.replace(scaled, y=flight.known(y), nominal=nominal))
    return scaled_flights


def healthy_prior(
    effect: Effect, e: FlightResiduals, tolerance: Tolerance, *, changed: bool = False
) -> dict[str, tuple[float, float]]:
    """Return the usual value of parameters of an effect, and by how much healthy vehicles differ in
    it; empty where they do not.

    Args:
        changed: since flights before, which is not what a vehicle differs by from its file.
    """
    prior_spread = dict[str, tuple[float, float]]()
    stated = [d for d in file_priors(e.vehicle, tolerance) if d.stated]
    vehicle = [*of_vehicle(e, tolerance), *stated] if not changed else []
    # Since flights before, thrust over throttle of a described vehicle differs by its battery too.
    flight = of_flight(e, tolerance) if tolerance.unmeasured else of_battery(e)
    for d in (*vehicle, *flight):
        if d.is_of(effect) and not d.at_value:
            for p in (p for p in effect.parameters if p.name in d.sigma):
                _, known = prior_spread.get(p.name, (0.0, 0.0))
                prior_spread[p.name] = d.usual(p), math.hypot(known, d.sigma[p.name])
    if (tolerance.unmeasured or changed) and isinstance(effect, MassError):
        # Thrust over throttle takes its place.
        for d in (d for d in of_battery(e) if d.effect is ThrustScale):
            prior_spread["delta_mass"] = 0.0, d.sigma["scale"] * e.vehicle.mass
    # What is said of some parameters alone does not excuse the others.
    return (
        prior_spread
        if prior_spread.keys() >= {p.name for p in effect.parameters if not p.choices}
        else {}
    )


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
    departures = list[Difference]()
    vehicle = flights[0].vehicle
    rotors = named_rotors([flight.log for flight in flights], vehicle)
    for k, f in enumerate(fit.free):
        i = f.term - len(fit.terms)
        if i < 0 or f.flight:
            continue
        effect = fit.calibration[i].effect
        d = fit.allowed[i]
        sigma = float(np.sqrt(fit.covariance[k, k]))
        p = next(p for p in effect.parameters if p.name == f.name)
        if isinstance(effect, ThrottleCurve):
            known = flights[0].log.throttle_map
            usual = known.exponent if isinstance(known, PowerMap) else hover_exponent(vehicle)
            departures.append(_throttle_map(d, p, usual, effect.curve, sigma))
        elif tolerance.unmeasured or vehicle.measured or d.stated:
            departures.append(_difference(d, p, getattr(effect, f.name) - f.neutral, sigma, rotors))
    if tolerance.unmeasured:
        errors = fit.linear[: len(flights)]
        body = fit.linear[-2]
        departures += _of_parameters(body, of_vehicle(flights[0], tolerance), rotors)
        parts = {
            flight.name: _of_parameters(part, of_flight(flight, tolerance), rotors)
            for flight, part in zip(flights, errors, strict=True)
        }
        departures += _of_flights(parts)
    return tuple(sorted(departures, key=lambda d: -d.in_deviations))


def _throttle_map(
    d: EffectPrior, p: Parameter, nominal: float, curve: float, sigma: float
) -> Difference:
    """Return the power of throttle with which thrust goes, over that of the nominal map."""
    value = nominal * (1 + curve)
    half = HALF_WIDTH_95 * nominal * sigma
    text = "the power of throttle in thrust is hardly told"
    if half < HARDLY * value:
        text = f"thrust goes with the power {number(value, 3)} of throttle"
    away = value - nominal
    spread = THROTTLE_CURVE * nominal
    return Difference(f"{d.name}.{p.name}", text, away, "1", spread, (away - half, away + half))


def _of_parameters(
    part: LinearPart, effect_priors: Sequence[EffectPrior], rotors: Sequence[RotorName]
) -> list[Difference]:
    """Return the parameters of deviations; the lags of rotors, which each act by a share, as
    one.
    """
    entries = [
        (d, next(p for p in d.effect.parameters if p.name == name))
        for d in effect_priors
        for name in d.sigma
    ]
    size = np.array([d.sigma[p.name] for d, p in entries])
    first = slice(len(size))  # before the drift of a flight
    value = part.coefficients[first] * size
    covariance = part.covariance[first, first] * np.outer(size, size)
    departures = [
        _difference(d, p, value[k], np.sqrt(covariance[k, k]), rotors)
        for k, (d, p) in enumerate(entries)
        if not d.at_value
    ]
    if lags := [k for k, (d, _) in enumerate(entries) if d.at_value]:
        d, p = entries[lags[-1]]
        lag = dc.replace(d, sigma={p.name: float(np.linalg.norm(size[lags]))})
        departures.append(
            _difference(
                lag, p, value[lags].sum(), np.sqrt(covariance[np.ix_(lags, lags)].sum()), rotors
            )
        )
    return departures


def _of_flights(by_flight: Mapping[str, Sequence[Difference]]) -> list[Difference]:
    """Return what flights differ by, each parameter with its value in every flight and the words of
    the largest.
    """
    each: dict[str, dict[str, Difference]] = {}
    for flight, departures in by_flight.items():
        for d in departures:
            each.setdefault(d.name, {})[flight] = d
    largest = [max(of, key=lambda flight: of[flight].in_deviations) for of in each.values()]
    return [
        dc.replace(
            of[name],
            text=f"{of[name].text} in {name}",
            by_flight={flight: d.value for flight, d in of.items()},
        )
        for name, of in zip(largest, each.values(), strict=True)
    ]


def _difference(
    d: EffectPrior, p: Parameter, value: float, sigma: float, rotors: Sequence[RotorName]
) -> Difference:
    """Return a departure from the neutral value in words."""
    rotor = rotors[round(d.fixed["rotor"]) - 1] if "rotor" in d.fixed else ""
    unit, text = departure(p, value, rotor, shares=d.effect.shares)
    half = HALF_WIDTH_95 * sigma
    spread = float(d.sigma[p.name])
    return Difference(
        f"{d.name}.{p.name}",
        text,
        float(value),
        unit or "1",
        spread,
        (float(value - half), float(value + half)),
    )
