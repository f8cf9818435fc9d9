"""Laws of states in rotorpy's form."""

import numpy as np
import pytest

pytest.importorskip("rotorpy", reason="rotorpy is not installed: pip install 'np_drake[challenge]'")

from diagrams.challenge.simulators.rotorpy.conversion import (
    SPEED,
    Q,
    V,
    X,
    from_rotorpy,
    rotor_speeds,
    to_rotorpy,
)
from np_drake.vehicle import Vehicle

CENTER = np.array([0.03, -0.02, 0.05])  # p_BoBcm_B [m]


def test_a_state_comes_back_as_it_was():
    rng = np.random.default_rng(0)
    x = rng.normal(size=13)
    x[3:7] /= np.linalg.norm(x[3:7])
    speed = rng.uniform(100.0, 900.0, 4)
    s = to_rotorpy(x, CENTER, speed)
    np.testing.assert_allclose(from_rotorpy(s, CENTER), x, atol=1e-14)
    np.testing.assert_array_equal(s[SPEED], speed)


def test_the_centre_of_mass_of_a_yawing_vehicle_moves_across_its_lever():
    x = np.zeros(13)
    x[3], x[12] = 1.0, 2.0  # level, yaw rate [rad/s]
    s = to_rotorpy(x, CENTER, np.zeros(4))
    np.testing.assert_array_equal(s[X], CENTER)
    np.testing.assert_allclose(s[V], [-2.0 * CENTER[1], 2.0 * CENTER[0], 0.0])
    np.testing.assert_array_equal(s[Q], [0.0, 0.0, 0.0, 1.0])


def test_rotors_at_these_speeds_give_the_command():
    vehicle, u = Vehicle(), np.array([18.0, 0.1, -0.2, 0.03])
    thrust = vehicle.thrust_coefficient * rotor_speeds(vehicle, u) ** 2
    np.testing.assert_allclose(vehicle.mixer @ thrust, u)
