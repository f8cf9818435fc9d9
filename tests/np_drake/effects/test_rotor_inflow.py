import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.effects.base import Motion
from np_drake.effects.rotor_inflow import AIR_DENSITY, RotorInflow, induced_velocity
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
F = VEHICLE.mass * VEHICLE.gravity / 4
V_HOVER = np.sqrt(F / (2 * AIR_DENSITY * np.pi * VEHICLE.rotor_radius**2))
GAIN = 0.6 * AIR_DENSITY * np.pi * VEHICLE.rotor_radius**3 / 4  # [N·s²/(m·rad)]
SPEED = np.sqrt(F / VEHICLE.thrust_coefficient)


def flying(v=(0.0, 0.0, 0.0)):
    return Motion(0.0, np.array([0, 0, 1.0, 1.0, 0, 0, 0, *v, 0, 0, 0]), np.full(4, F))


def test_nothing_changes_in_hover():
    np.testing.assert_allclose(RotorInflow().wrench(VEHICLE, flying()), np.zeros(6), atol=1e-12)


@given(st.floats(-0.9, 3.0))
def test_the_induced_velocity_in_axial_flow_is_the_root_of_a_quadratic(ratio):
    climb = ratio * V_HOVER
    closed = -climb / 2 + np.sqrt(climb**2 / 4 + V_HOVER**2)
    assert induced_velocity(np.array(V_HOVER), np.array(0.0), np.array(climb)) == pytest.approx(
        closed, rel=1e-9
    )


@given(st.floats(0.0, 15.0), st.floats(-4.0, 10.0), st.floats(0.5, 8.0))
def test_the_induced_velocity_solves_glauerts_equation(lateral, axial, at_rest):
    v = induced_velocity(np.array(at_rest), np.array(lateral), np.array(max(axial, -at_rest)))
    assert v * np.hypot(lateral, v + max(axial, -at_rest)) == pytest.approx(at_rest**2, rel=1e-6)


def test_a_slow_climb_loses_half_of_what_a_fixed_inflow_would():
    climb = 1e-4
    force = RotorInflow().wrench(VEHICLE, flying((0, 0, climb)))[2]
    assert force == pytest.approx(-4 * GAIN * SPEED * climb / 2, rel=1e-3)
