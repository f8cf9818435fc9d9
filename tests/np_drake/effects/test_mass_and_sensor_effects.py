"""Laws of effects of mass, sensors and time, and of effects together."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake import attitude
from np_drake.effects.attached_mass import AttachedMass
from np_drake.effects.attitude_bias import AttitudeBias
from np_drake.effects.attitude_latency import AttitudeLatency
from np_drake.effects.base import MassProperties, Measurement
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.combine import mass_properties, split_effects
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.imu_mounting import ImuMounting
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.library import LIBRARY
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.sensor_noise import SensorNoise
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_ceiling import ThrustCeiling
from np_drake.effects.velocity_bias import VelocityBias
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle

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


def test_mass_effects_add_up_whatever_their_order():
    effects = [MassError(0.3), InertiaError(1.2, 1.2, 1.2), CenterOfMassOffset(0.01, 0.02, 0.03)]
    for order in (effects, effects[::-1]):
        found = mass_properties(VEHICLE, order)
        assert found.mass == 2.3
        np.testing.assert_allclose(found.J, 1.2 * VEHICLE.J)
        np.testing.assert_allclose(found.p_BoBcm_B, [0.01, 0.02, 0.03])


@pytest.mark.parametrize("rotor", [1, 2, 3, 4])
def test_an_attached_mass_is_two_bodies_about_their_common_centre(rotor):
    found = mass_properties(
        VEHICLE, [CenterOfMassOffset(0.01, 0.02, 0.03), AttachedMass(rotor, 0.5)]
    )
    parts = [(2.0, np.array([0.01, 0.02, 0.03])), (0.5, VEHICLE.rotor_positions_B[rotor - 1])]
    center = sum(mass * place for mass, place in parts) / 2.5
    J = VEHICLE.J.copy()
    for mass, place in parts:
        off = place - center
        J += mass * (off @ off * np.eye(3) - np.outer(off, off))
    assert found.mass == 2.5
    np.testing.assert_allclose(found.p_BoBcm_B, center)
    np.testing.assert_allclose(found.J, J)


def test_a_gyro_bias_adds_to_the_body_rates():
    found = GyroBias(0.1, -0.2, 0.3).measure(VEHICLE, reading(QUARTER), NO_DRAWS)
    np.testing.assert_allclose(found.x[10:13], [0.1, -0.2, 0.3])


def test_a_velocity_bias_turns_with_the_body():
    found = VelocityBias(1.0, 0.0, 0.5).measure(VEHICLE, reading(QUARTER), NO_DRAWS)
    np.testing.assert_allclose(found.x[7:10], [0, 1.0, 0.5], atol=1e-15)


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


def test_every_effect_has_its_place():
    effects = [effect() for effect in LIBRARY.values()]
    found = split_effects([*effects, SensorNoise()])
    assert found.payload == SuspendedPayload()
    assert [e for e in effects if e.place == "mass"] == found.mass
    assert [e for e in effects if e.place == "actuator"] == found.actuator
    assert [e for e in effects if e.place == "wrench" and e != found.payload] == found.wrench
    assert [*(e for e in effects if e.place == "measurement"), SensorNoise()] == found.measurement


def test_two_payloads_and_strangers_are_refused():
    with pytest.raises(ValueError, match="got two"):
        split_effects([SuspendedPayload(), SuspendedPayload(0.5)])
    with pytest.raises(ValueError, match="split_effects"):
        split_effects([object()])


def test_no_rotor_gives_more_than_the_ceiling():
    thrust = ThrustCeiling(share=0.5).thrust(
        Vehicle(), np.zeros(0), np.array([1.0, 5.9, 6.1, 12.0])
    )
    np.testing.assert_allclose(thrust, [1.0, 5.9, 6.0, 6.0])  # half of 12 N


LAGGED = Vehicle(rotor_time_constant=0.02)


@pytest.mark.parametrize(
    "effect, shift",
    [
        (MotorLag(0.05), 0.03),
        (MotorLag(0.013), -0.007),
        (CommandDelay(0.02), 0.02),
        (ClockOffset(0.02), -0.02),
        (LinearDrag(1.0, 1.0, 1.0), 0.0),
    ],
)
def test_lag_delay_and_clock_alone_move_commands(effect, shift):
    assert effect.time_shift(LAGGED) == pytest.approx(shift)


G = np.array([0.0, 0.0, VEHICLE.gravity])
NOISE = MeasurementNoise(
    position=0.1, attitude=0.4, velocity=0.2, rate=0.3, acceleration=0.7, angular_acceleration=1.1
)
DUT = SensorNoise(NOISE, rotor=5.0)


def truth_of(seed: int) -> Measurement:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal(13)
    x[3:7] /= np.linalg.norm(x[3:7])
    return Measurement(x, rng.standard_normal(3), rng.standard_normal(3), 100 * rng.random(4))


@pytest.mark.parametrize("seed", range(2))
def test_one_instant_reads_as_a_row_of_many(seed):
    truth, white = truth_of(seed), np.random.default_rng(100 + seed).standard_normal(22)
    once, names = DUT.measure(VEHICLE, truth, white), ("x", "a", "al", "rotor")
    rows = Measurement(*(getattr(truth, name)[None] for name in names))
    many = DUT.measure(VEHICLE, rows, white[None])
    for name in names:
        np.testing.assert_allclose(getattr(many, name)[0], getattr(once, name), atol=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_attitude_turns_about_body_axes_and_acceleration_turns_with_it(seed):
    truth, white = truth_of(seed), np.random.default_rng(100 + seed).standard_normal(22)
    read = DUT.measure(VEHICLE, truth, white)
    turn = attitude.multiply(attitude.conjugate(truth.x[3:7]), read.x[3:7])
    np.testing.assert_allclose(turn[1:] / turn[0], 0.5 * 0.4 * white[3:6], atol=1e-12)
    felt, true = (attitude.rotate_back(m.x[3:7], m.a + G) for m in (read, truth))
    np.testing.assert_allclose(felt - true, 0.7 * white[12:15], atol=1e-12)


MOUNTED, LATE = ImuMounting(0.05, -0.03, 0.02), AttitudeLatency(0.02)


def spinning(w: np.ndarray, t: np.ndarray) -> Measurement:
    """Return a motion with constant body rates w (3,) [rad/s]."""
    x = np.zeros((len(t), 13))
    x[:, Q] = attitude.from_rotation_vector(t[:, None] * w)
    x[:, W] = w
    x[:, P], x[:, V] = [1.0, 2.0, 3.0], [0.4, 0.5, 0.6]
    return Measurement(x, np.ones((len(t), 3)), np.zeros((len(t), 3)), np.zeros((len(t), 4)))


def measured(effect, truth: Measurement) -> Measurement:
    return effect.measure(VEHICLE, truth, np.zeros((len(truth.x), 0)))


T = 0.01 * np.arange(200)
TRUTH = spinning(np.array([0.5, -0.8, 0.3]), T)


def test_turned_axes_read_a_vector_of_the_world_turned_by_the_mounting():
    x = measured(MOUNTED, TRUTH).x
    down = np.tile([0.0, 0.0, -9.81], (len(T), 1))
    turned = attitude.from_rotation_vector(np.array([[0.05, -0.03, 0.02]]))
    expected = attitude.rotate_back(
        np.repeat(turned, len(T), axis=0), attitude.rotate_back(TRUTH.x[:, Q], down)
    )
    np.testing.assert_allclose(attitude.rotate_back(x[:, Q], down), expected, atol=1e-12)


def test_turned_axes_read_rates_that_are_those_of_the_turned_attitude():
    x = measured(MOUNTED, TRUTH).x
    rate = (
        attitude.rotation_vector(attitude.multiply(attitude.conjugate(x[:-1, Q]), x[1:, Q]))
        / np.diff(T)[:, None]
    )
    np.testing.assert_allclose(rate, x[:-1, W], atol=1e-9)
    assert np.abs(x[:, W] - TRUTH.x[:, W]).max() > 0.01  # the true rates are not


def test_a_late_attitude_is_that_of_before_and_all_else_is_of_now():
    late = measured(LATE, TRUTH)
    # exact at constant rates
    np.testing.assert_allclose(late.x[2:, Q], TRUTH.x[:-2, Q], atol=1e-12)
    same = np.delete(np.arange(13), np.arange(13)[Q])
    np.testing.assert_array_equal(late.x[:, same], TRUTH.x[:, same])
    np.testing.assert_array_equal(late.a, TRUTH.a)
