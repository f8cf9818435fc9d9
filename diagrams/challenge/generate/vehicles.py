"""The vehicles of a challenge set: a handful of sizes, as their vehicle files know them."""

import dataclasses as dc

import numpy as np

from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle


def _diagonal(xx: float, yy: float, zz: float) -> list[list[float]]:
    return [[xx, 0.0, 0.0], [0.0, yy, 0.0], [0.0, 0.0, zz]]


def _cross(x: float, y: float, z: float = 0.0) -> list[list[float]]:
    """Return rotors 1 … 4 of an X frame with half lengths x, y and height z [m]."""
    return [[x, y, z], [x, -y, z], [-x, -y, z], [-x, y, z]]


VEHICLES: tuple[Vehicle, ...] = (
    Vehicle(),
    Vehicle(
        name="racer",
        mass=0.75,
        inertia=_diagonal(0.0025, 0.0021, 0.0043),
        rotor_positions=_cross(0.075, 0.1),
        thrust_coefficient=1.6e-6,
        torque_coefficient=2.2e-8,
        rotor_radius=0.065,
        max_rotor_thrust=7.0,
        rotor_time_constant=0.03,
    ),
    Vehicle(
        name="mapper",
        mass=1.2,
        inertia=_diagonal(0.0105, 0.0118, 0.0205),
        rotor_positions=_cross(0.15, 0.165, 0.02),
        thrust_coefficient=8.5e-6,
        torque_coefficient=1.5e-7,
        rotor_radius=0.115,
        max_rotor_thrust=7.5,
        rotor_time_constant=0.02,
    ),
    Vehicle(
        name="carrier",
        mass=3.2,
        inertia=_diagonal(0.046, 0.051, 0.088),
        rotor_positions=_cross(0.2, 0.21),
        rotor_directions=[-1.0, 1.0, -1.0, 1.0],
        thrust_coefficient=2.4e-5,
        torque_coefficient=4.3e-7,
        rotor_radius=0.15,
        max_rotor_thrust=19.0,
        rotor_time_constant=0.04,
    ),
    Vehicle(
        name="compact",
        mass=1.5,
        inertia=_diagonal(0.0095, 0.0088, 0.0165),
        rotor_positions=_cross(0.11, 0.13),
        thrust_coefficient=7.0e-6,
        torque_coefficient=1.2e-7,
        rotor_radius=0.09,
        max_rotor_thrust=9.5,
    ),
)


def draw_vehicle(rng: np.random.Generator, noise: MeasurementNoise) -> Vehicle:
    """Draw one of `VEHICLES`; its logs hold commands from their row."""
    kind = VEHICLES[rng.integers(len(VEHICLES))]
    return dc.replace(kind, measurement_noise=noise, command_timing="held").check()
