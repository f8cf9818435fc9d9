import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake import attitude
from np_drake.effects.attitude_bias import AttitudeBias
from np_drake.effects.base import MassProperties, Measurement
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.combine import mass_properties
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.mass_error import MassError
from np_drake.effects.velocity_bias import VelocityBias
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
QUARTER = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])  # yaw by 90 degrees: body x is world y
NO_DRAWS = np.zeros(0)
ANGLES = st.floats(-0.4, 0.4)


def reading(q=(1.0, 0, 0, 0)):
    return Measurement(
        np.array([0, 0, 1.0, *q, *np.zeros(6)]), np.zeros(3), np.zeros(3), np.zeros(4)
    )


def test_inertia_error_scales_the_moments_and_leaves_the_products():
    skew = Vehicle(inertia=[[0.02, 0.001, 0], [0.001, 0.02, 0], [0, 0, 0.035]])
    found = InertiaError(1.1, 0.9, 1.2).properties(MassProperties.of(skew)).J
    np.testing.assert_allclose(found, [[0.022, 0.001, 0], [0.001, 0.018, 0], [0, 0, 0.042]])


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(4, 7))
def test_points_of_mass_are_a_rigid_body_and_an_excess_about_one_axis_not(seed, points):
    rng = np.random.default_rng(seed)
    mass, r = rng.uniform(0.1, 1.0, points), rng.normal(size=(points, 3))
    r -= mass @ r / mass.sum()
    J = np.einsum("n,ij->ij", mass * np.sum(r**2, axis=1), np.eye(3)) - np.einsum(
        "n,ni,nj->ij", mass, r, r
    )
    assert MassProperties(float(mass.sum()), np.zeros(3), J).rigid
    moments, axes = np.linalg.eigh(J)
    beyond = axes @ np.diag([*moments[:2], 1.01 * moments[:2].sum()]) @ axes.T
    assert not MassProperties(1.0, np.zeros(3), beyond).rigid
    assert not MassProperties(0.0, np.zeros(3), J).rigid


def test_mass_effects_add_up_whatever_their_order():
    effects = [MassError(0.3), InertiaError(1.2, 1.2, 1.2), CenterOfMassOffset(0.01, 0.02, 0.03)]
    for order in (effects, effects[::-1]):
        found = mass_properties(VEHICLE, order)
        assert found.mass == 2.3
        np.testing.assert_allclose(found.J, 1.2 * VEHICLE.J)
        np.testing.assert_allclose(found.p_BoBcm_B, [0.01, 0.02, 0.03])


def test_a_gyro_bias_adds_to_the_body_rates():
    found = GyroBias(0.1, -0.2, 0.3).measure(VEHICLE, reading(QUARTER), NO_DRAWS)
    np.testing.assert_allclose(found.x[10:13], [0.1, -0.2, 0.3])


def test_a_velocity_bias_turns_with_the_body():
    found = VelocityBias(1.0, 0.0, 0.5).measure(VEHICLE, reading(QUARTER), NO_DRAWS)
    np.testing.assert_allclose(found.x[7:10], [0, 1.0, 0.5], atol=1e-15)


def test_an_attitude_bias_turns_about_the_bodys_own_axes():
    found = AttitudeBias(roll=0.1, pitch=0.0, yaw=0.0).measure(VEHICLE, reading(QUARTER), NO_DRAWS)
    # Body x is world y: the body's z axis tips towards world +x when it rolls.
    np.testing.assert_allclose(
        attitude.body_z(found.x[3:7]), [np.sin(0.1), 0, np.cos(0.1)], atol=1e-12
    )
    found = AttitudeBias(roll=0.0, pitch=0.1, yaw=0.0).measure(VEHICLE, reading(), NO_DRAWS)
    np.testing.assert_allclose(
        attitude.body_z(found.x[3:7]), [np.sin(0.1), 0, np.cos(0.1)], atol=1e-12
    )


@settings(max_examples=50, deadline=None)
@given(ANGLES, ANGLES, ANGLES)
def test_an_attitude_bias_is_a_rotation_by_yaw_pitch_roll(roll, pitch, yaw):
    R = attitude.rotation_matrix(AttitudeBias(roll, pitch, yaw).dq)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.arctan2(R[2, 1], R[2, 2]), roll, atol=1e-12)
    np.testing.assert_allclose(-np.arcsin(R[2, 0]), pitch, atol=1e-12)
    np.testing.assert_allclose(np.arctan2(R[1, 0], R[0, 0]), yaw, atol=1e-12)


def test_a_clock_offset_says_by_how_much_and_reads_the_truth():
    truth = reading()
    assert ClockOffset(0.05).measure(VEHICLE, truth, NO_DRAWS) is truth
    assert ClockOffset(0.05).clock_shift == 0.05
