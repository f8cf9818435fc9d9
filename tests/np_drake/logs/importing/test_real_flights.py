"""Laws of imported real flights: rotors carry a vehicle with nothing attached, and a payload pulls on it."""

import numpy as np
import pytest

from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.logs.importing.import_log import import_log
from np_drake.rotor_input import with_rotor_input
from np_drake.vehicle import Vehicle

# Facts of the campaign (IMRCLab crazyflie-data-collection) and of shared/real/README.md.
BARE = Vehicle(
    name="crazyflie_brushless",
    mass=0.037,
    inertia=[[1.9e-5, 0.0, 0.0], [0.0, 1.9e-5, 0.0], [0.0, 0.0, 3.2e-5]],
    rotor_positions=[[0.0325, -0.0325, 0], [-0.0325, -0.0325, 0], [-0.0325, 0.0325, 0], [0.0325, 0.0325, 0]],
    rotor_directions=[-1.0, 1.0, -1.0, 1.0],
    thrust_coefficient=3.704e-8,
    torque_coefficient=0.006 * 3.704e-8,
    rotor_radius=0.025,
    max_rotor_thrust=0.25,
    input="rotor_speed",
)
MOST = 0.03  # RMS of each axis over weight [1]


def residual_force(path, vehicle: Vehicle) -> np.ndarray:
    """RMS of the residual force in B over weight, (3,) [1]."""
    (flight,) = import_log(path).flights
    residuals = make_flight_residuals(with_rotor_input(flight, vehicle), vehicle)
    kept = residuals.y[~residuals.outliers, :3]
    return np.sqrt(np.mean(kept**2, axis=0)) / (vehicle.mass * vehicle.gravity)


def test_the_rotors_carry_a_bare_vehicle_to_three_percent_of_its_weight(real_flights):
    paths = sorted((real_flights / "imrc" / "bare").iterdir())
    assert len(paths) >= 10
    worst = {path.name: residual_force(path, BARE).max() for path in paths}
    assert max(worst.values()) < MOST, worst


def test_a_payload_of_five_grams_pulls_down_by_its_weight(real_flights):
    vehicle = BARE.with_mass(0.0397)
    flight = residual_force(real_flights / "imrc" / "payload" / "eckart06", vehicle)
    assert flight[2] == pytest.approx(0.0047 / 0.0397, abs=0.03)
