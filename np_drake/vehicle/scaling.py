"""Characteristic sizes of a vehicle, and quantities that scale with them by Froude similarity.

Length L is the mean distance of the rotors from Bo, mass m and gravity g are the vehicle's. With
time T = sqrt(L / g), speed L / T, force m g and torque m g L, eq. (1) of any quadrotor reads the
same; what is left of the vehicle are its dimensionless numbers: thrust over weight, inertia over m
L² and yaw torque over thrust times arm. Two vehicles that share them fly the same dimensionless
trajectory (W. Froude's similarity, with gravity as the only common scale).

A default that stands in SI in the code is that of the paper's vehicle. For another vehicle it is
multiplied by the ratio of the two vehicles' units, which is exactly 1 for the paper's.
"""

import dataclasses as dc
import math

import numpy as np

from np_drake.vehicle.vehicle import RateLoop, Vehicle

PERIOD = 0.02  # between solves, of the paper's vehicle [s]
# largest default payload over the mass that the rotors could carry beside the vehicle [1]
SPARE_LIFT = 0.25


@dc.dataclass(frozen=True)
class Scales:
    """Units of length, mass and time that a vehicle brings; all others follow."""

    length: float  # L, mean distance of the rotors from Bo [m]
    mass: float  # m [kg]
    time: float  # T = sqrt(L / g) [s]

    @property
    def force(self) -> float:
        """Weight, m L / T² = m g [N]."""
        return self.mass * self.length / self.time**2

    @property
    def torque(self) -> float:
        """Weight times arm, m g L [N·m]."""
        return self.force * self.length

    @property
    def clock(self) -> float:
        """Power of two nearest to a ratio of times; sampling rates scale with it, so that they stay
        round [1].
        """
        return 2.0 ** round(math.log2(self.time))


def scales(vehicle: Vehicle) -> Scales:
    """Return the units of length, mass and time of `vehicle`."""
    length = float(np.mean(np.linalg.norm(vehicle.rotor_positions_B, axis=1)))
    return Scales(length, vehicle.mass, math.sqrt(length / vehicle.gravity))


def ratios(vehicle: Vehicle) -> Scales:
    """Return the units of `vehicle` over those of the paper's vehicle; all are exactly 1 for the
    latter.
    """
    return over_paper(scales(vehicle))


def over_paper(unit: Scales) -> Scales:
    """Return the units `own` over those of the paper's vehicle."""
    paper = scales(Vehicle())
    return Scales(unit.length / paper.length, unit.mass / paper.mass, unit.time / paper.time)


def sampling_period(vehicle: Vehicle) -> float:
    """Return the default time between solves of the controller and samples of a predictor [s]."""
    return PERIOD * ratios(vehicle).clock


def usual_rate_loop(vehicle: Vehicle) -> RateLoop:
    """Return the rate loop of a usual tune of an autopilot, that of the paper's vehicle at the pace
    of `vehicle`.
    """
    pace = ratios(vehicle).time
    paper = RateLoop()
    return RateLoop(
        [pace * lag for lag in paper.lag], paper.gain, [rate / pace for rate in paper.max_rate]
    )


def payload_ratio(vehicle: Vehicle, paper_mass: float) -> float:
    """Return the default payload's mass over that of the paper's payload [1].

    It is a fixed share of the vehicle's mass, but no more than `SPARE_LIFT` of what the rotors
    could carry beyond it.

    Args:
        paper_mass: of the payload of the paper's vehicle [kg].
    """
    spare = 4 * vehicle.max_rotor_thrust / vehicle.gravity - vehicle.mass
    return min(vehicle.mass / Vehicle().mass, SPARE_LIFT * spare / paper_mass)


@dc.dataclass(frozen=True)
class Numbers:
    """Dimensionless numbers of a vehicle, in which two similar vehicles agree."""

    thrust_to_weight: float  # largest thrust of all rotors over weight [1]
    inertia: tuple[float, float, float]  # moments of inertia about body axes over m L² [1]
    yaw_arm: float  # reaction torque over thrust, over L [1]
    turn_time: float  # time to tilt by 1 rad from rest under half the largest torque, over T [1]


def numbers(vehicle: Vehicle) -> Numbers:
    """Return the dimensionless numbers of `vehicle`.

    The roll and pitch authority is taken as half the largest thrust of two rotors on either side of
    an axis.
    """
    unit = scales(vehicle)
    J = np.diag(vehicle.J)
    arm = np.abs(vehicle.rotor_positions_B[:, :2])
    torque = 0.5 * vehicle.max_rotor_thrust * arm.sum(axis=0)[::-1]  # about x by the arms along y
    x, y, z = (J / (unit.mass * unit.length**2)).tolist()
    return Numbers(
        thrust_to_weight=4 * vehicle.max_rotor_thrust / (vehicle.mass * vehicle.gravity),
        inertia=(x, y, z),
        yaw_arm=vehicle.torque_coefficient / vehicle.thrust_coefficient / unit.length,
        turn_time=float(np.sqrt(2 * J[:2] / torque).max() / unit.time),
    )
