"""Calibration as columns of the regression, in units of the spread of healthy vehicles."""

import dataclasses as dc
from collections.abc import Callable, Sequence

import numpy as np

from np_drake.diagnosis.calibration.spread import Deviation, of_flight, of_vehicle
from np_drake.diagnosis.fitting import Fit
from np_drake.diagnosis.forward_model import StageCache, Term, predicted_residual
from np_drake.diagnosis.options import SPREAD, Priors, Spread, Tolerance
from np_drake.diagnosis.regressors.generic import PREFIX, generic_candidates
from np_drake.diagnosis.regressors.library import LINEAR, Candidate
from np_drake.diagnosis.regressors.nuisance import calibration
from np_drake.diagnosis.residuals import WRENCH, FlightResiduals
from np_drake.effects.base import ActuatorEffect, Effect, MassEffect
from np_drake.effects.calibration import in_flight
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.parameter import arm

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
