"""Nuisance parameters: errors of the vehicle file and the sensors within tolerance, part of every model.

Mass and thrust errors are the same in all flights; sensor errors differ from flight to flight.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.regressors.library import Candidate
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.tolerance import IDEAL_SENSORS, Tolerance
from np_drake.effects.accelerometer_bias import AccelerometerBias
from np_drake.effects.attitude_bias import AttitudeBias
from np_drake.effects.attitude_latency import AttitudeLatency
from np_drake.effects.base import Effect
from np_drake.effects.battery_sag import BatterySag
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.imu_mounting import ImuMounting
from np_drake.effects.mass_error import MassError
from np_drake.effects.throttle_curve import ThrottleCurve
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.effects.velocity_bias import VelocityBias
from np_drake.vehicle import Vehicle


def calibration_terms(vehicle: Vehicle, tolerance: Tolerance) -> list[tuple[Term, float]]:
    """Return the terms that all flights share, each with the standard deviation of its prior.

    Mass and thrust of the vehicle file, and what the input of the logs leaves open.
    """
    open_ = [
        (Term(ThrottleCurve(0.0)), tolerance.throttle_curve),
        (Term(BatterySag(0.0)), tolerance.throttle_drift),
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
        columns = {e.name: np.stack([predicted_residual(e, [m]) for m in moved], axis=-1) for e in flights}
        out.append(Candidate((), "calibration", columns, lambda c: []))
    return out


def sensor_drift(flights: Sequence[FlightResiduals], tolerance: Tolerance) -> Candidate | None:
    """Return the sensor errors of every flight as one candidate; None for ideal sensors."""
    if not tolerance.real:
        return None
    sensors: tuple[type[Effect], ...] = (AccelerometerBias, AttitudeBias, GyroBias, VelocityBias)
    units = [
        (sensor, p.name, tolerance.of(sensor))
        for sensor in sensors
        for p in sensor.parameters
        if not p.choices and not (sensor is AccelerometerBias and flights[0].log.a is None)
    ]
    columns = {}
    for i, e in enumerate(flights):
        X = np.zeros((*e.y.shape, len(units) * len(flights)))
        for j, (sensor, name, deviation) in enumerate(units):
            values = {p.name: deviation if p.name == name else p.neutral for p in sensor.parameters}
            X[..., i * len(units) + j] = predicted_residual(e, [Term(sensor.of(values))])
        columns[e.name] = X
    return Candidate((), "sensor drift", columns, lambda c: [])


REAL = 1e-3  # attitude noise above which sensors are taken as real [rad]


def tolerance_of(flights: Sequence[FlightResiduals]) -> Tolerance:
    """Return the tolerance for real sensors, or for ideal ones where the logs look like those of a simulator.

    These have attitudes without noise, commands in newtons, and state when a command acts. An estimator's attitude has
    little noise as well, but such logs miss one of the others.
    """
    ideal = all(
        e.attitude_noise <= REAL and e.log.input == "command" and e.knows_torque and e.log.timing == 0
        for e in flights
    )
    return IDEAL_SENSORS if ideal else Tolerance()
