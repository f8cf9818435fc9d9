"""Nuisance parameters: errors of the vehicle file and the sensors within tolerance, part of every
model.

Mass and thrust errors are the same in all flights; sensor errors differ from flight to flight.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.numerics import fit_noise
from np_drake.diagnosis.options import IDEAL_SENSORS, SPREAD, Options, Tolerance
from np_drake.diagnosis.regressors.library import Candidate
from np_drake.diagnosis.residuals import QUIET, FlightResiduals
from np_drake.effects.attitude_latency import AttitudeLatency
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.imu_mounting import ImuMounting
from np_drake.effects.mass_error import MassError
from np_drake.effects.throttle_curve import ThrottleCurve
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.vehicle import Vehicle

# Of thrust over throttle, where flights alone tell it [1]; source: own choice, for what hangs below
# may weigh as much.
THROTTLE_SCALE = 0.5
# Of thrust over rotor speed squared [1]; source: density of air, 2 % for 6 K or 20 hPa.
ROTOR_SPEED_SCALE = 0.02
THROTTLE_CURVE = 0.3  # of its exponent [1]; source: that of `throttle_input.SCATTER` over `USUAL`
# Of a map in the vehicle file that states no uncertainty: of its scale, and of its exponent [1];
# source: own choice.
IDENTIFIED_SCALE, IDENTIFIED_CURVE = 0.05, 0.05
# Deviations by which motion is ahead of commands, from which these are not held from their row [1].
EARLY = 3.0


def calibration_terms(vehicle: Vehicle, tolerance: Tolerance) -> list[tuple[Term, float]]:
    """Return the terms that all flights share, each with the standard deviation of its prior."""
    open_ = [
        (Term(ThrottleCurve(0.0)), tolerance.throttle_curve),
        (Term(ClockOffset(0.0)), tolerance.timing),
        (Term(ImuMounting(0.0)), tolerance.mounting),
        (Term(AttitudeLatency(0.0)), tolerance.latency),
    ]
    return [
        (Term(ThrustScale(1.0)), tolerance.thrust),
        (Term(MassError(0.0)), tolerance.mass * vehicle.mass),
        *(pair for pair in open_ if pair[1] > 0),
    ]


def calibration(flights: Sequence[FlightResiduals], tolerance: Tolerance) -> list[Candidate]:
    """Return the mass and thrust terms as candidates, whose columns carry the prior's scale."""
    out = []
    for term, deviation in calibration_terms(flights[0].vehicle, tolerance):
        moved = [
            Term(dc.replace(term.effect, **{p.name: p.neutral + deviation}))  # type: ignore[type-var]
            for p in term.effect.parameters
        ]
        columns = {
            e.name: np.stack([predicted_residual(e, [m]) for m in moved], axis=-1) for e in flights
        }
        out.append(Candidate((), "calibration", columns, lambda c: []))
    return out


def tolerance_of(flights: Sequence[FlightResiduals]) -> Tolerance:
    """Return the tolerance for real sensors, or for ideal ones where the logs look like those of a
    simulator.

    These have attitudes without noise, commands in newtons, and state when a command acts.
    """
    ideal = all(
        e.attitude_noise <= QUIET
        and e.log.input == "command"
        and e.knows_torque
        and e.log.timing == 0
        for e in flights
    )
    return IDEAL_SENSORS if ideal else Tolerance()


def options_of(flights: Sequence[FlightResiduals], *, real: bool | None = None) -> Options:
    """Return the options of these flights (`with_input`).

    Args:
        real: whether their sensors are; None: as the logs look.
    """
    return with_input(
        Options.for_sensors(tolerance_of(flights).real if real is None else real), flights
    )


def with_input(options: Options, flights: Sequence[FlightResiduals]) -> Options:
    """Return the options whose tolerance holds what vehicle file and input of these flights leave
    open.
    """
    vehicle, log_input = flights[0].vehicle, flights[0].log.input
    tolerance = options.tolerance.with_vehicle(vehicle)
    unmeasured = tolerance.real and not vehicle.described
    open_ = {"timing": max(tolerance.timing, command_timing(flights))}
    if flights[0].measured_rotors:
        open_["thrust"] = max(tolerance.thrust, ROTOR_SPEED_SCALE)
    if log_input == "normalised":
        known = vehicle.throttle is not None
        scale = vehicle.thrust_uncertainty or IDENTIFIED_SCALE if known else THROTTLE_SCALE
        open_["thrust"] = max(tolerance.thrust, scale)
        open_["throttle_curve"] = max(
            tolerance.throttle_curve, IDENTIFIED_CURVE if known else THROTTLE_CURVE
        )
    if (
        log_input == "normalised" and not unmeasured
    ):  # the calibration of an unmeasured vehicle holds these
        open_["mounting"] = max(tolerance.mounting, SPREAD.mounting)
        open_["latency"] = max(tolerance.latency, SPREAD.latency)
    return dc.replace(options, tolerance=dc.replace(tolerance, **open_, unmeasured=unmeasured))


def command_timing(flights: Sequence[FlightResiduals]) -> float:
    """Return the deviation of the time at which a row's command acts [s].

    It is what the logs state, or half a row where motion is ahead of commands, as in a log of which
    rows were left out. A vehicle file can state that commands are held (`command_timing: held`).
    """
    if flights[0].measured_rotors:
        return 0.0
    stated = max(e.log.timing for e in flights)
    if flights[0].vehicle.described:
        return stated
    half = 0.5 * max(e.log.step for e in flights)
    shift, deviation = _early(flights, 0.5 * half)
    sampled = shift > EARLY * deviation and shift - 2 * deviation < half
    return max(stated, half) if sampled else stated


def _early(flights: Sequence[FlightResiduals], step: float) -> tuple[float, float]:
    """Return the time by which motion is ahead of the commands, and its standard deviation [s].

    Generalised least squares on the residual with all else in its noise.
    step: of the finite difference [s].
    """
    noise = fit_noise([e.y for e in flights], flights[0].grid.step)
    power = product = 0.0
    for e in flights:
        column = predicted_residual(e, [Term(ClockOffset(step))])
        column[:, 6:] = 0.0  # the commands alone
        white = noise.whiten(np.stack([column, e.y], axis=-1), e.name)
        power += float(np.sum(white[..., 0] ** 2))
        product += float(np.sum(white[..., 0] * white[..., 1]))
    if power == 0.0:
        return 0.0, np.inf
    return step * product / power, step / np.sqrt(power)
