import numpy as np
import pytest
from scipy.integrate import solve_ivp

from np_drake.effects.base import Measurement, Motion
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.pendulum import Payload, hook_wrench, swing, tether_force
from np_drake.effects.sensor_noise import SensorNoise
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle

VEHICLE = Vehicle()
HOVER = np.full(4, 2.0 * 9.81 / 4)
LEVEL = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0, 0, 0, 0, 0, 0])


def test_drag_at_hover_speed_opposes_velocity_with_its_coefficient():
    x = LEVEL.copy()
    x[7:10] = [1.0, -2.0, 3.0]
    chi = LinearDrag(0.2, 0.3, 0.4).wrench(VEHICLE, Motion(0.0, x, HOVER))
    np.testing.assert_allclose(chi, [-0.2, 0.6, -1.2, 0, 0, 0], atol=1e-12)


def test_drag_follows_the_body_axes():
    x = LEVEL.copy()
    x[3:7] = [np.sqrt(0.5), 0, 0, np.sqrt(0.5)]  # yaw by 90 degrees: world x is body -y
    x[7:10] = [1.0, 0, 0]
    chi = LinearDrag(0.2, 0.3, 0.4).wrench(VEHICLE, Motion(0.0, x, HOVER))
    np.testing.assert_allclose(chi[:3], [-0.3, 0, 0], atol=1e-12)


def test_drag_of_a_log_equals_drag_row_by_row():
    rng = np.random.default_rng(0)
    x, thrust = rng.normal(size=(5, 13)), rng.uniform(1, 5, (5, 4))
    dut = LinearDrag(0.2, 0.3, 0.4)
    rows = [dut.wrench(VEHICLE, Motion(0.0, x[i], thrust[i])) for i in range(5)]
    np.testing.assert_allclose(dut.wrench(VEHICLE, Motion(0.0, x, thrust)), rows, atol=1e-13)


def test_lag_rests_where_the_thrust_equals_the_command():
    dut, thrust = MotorLag(0.03), np.array([1.0, 2.0, 3.0, 4.0])
    state = dut.state_at(VEHICLE, thrust)
    np.testing.assert_allclose(dut.state_rate(VEHICLE, state, thrust), 0.0, atol=1e-9)
    np.testing.assert_allclose(dut.thrust(VEHICLE, state, thrust), thrust)


def test_thrust_scale_scales():
    np.testing.assert_allclose(ThrustScale(0.9).thrust(VEHICLE, np.zeros(0), HOVER), 0.9 * HOVER)


def test_noise_has_the_deviations_asked():
    noise = MeasurementNoise(0.1, 0.2, 0.01, 0.4, 0.5, 0.6)
    truth = Measurement(np.tile(LEVEL, (20000, 1)), *np.zeros((2, 20000, 3)), np.zeros((20000, 4)))
    white = np.random.default_rng(1).normal(size=(20000, 22))
    read = SensorNoise(noise, rotor=3.0).measure(VEHICLE, truth, white)
    error = read.x - truth.x
    for columns, deviation in ((slice(0, 3), 0.1), (slice(7, 10), 0.2), (slice(10, 13), 0.4)):
        assert error[:, columns].std() == pytest.approx(deviation, rel=0.03)
    assert 2 * error[:, 4:7].std() == pytest.approx(0.01, rel=0.03)  # half angles
    # Lateral: accelerometer noise and g times the attitude error; vertical: accelerometer noise
    # alone.
    assert read.a[:, 2].std() == pytest.approx(0.5, rel=0.03)
    assert read.a[:, 0].std() == pytest.approx(np.hypot(0.5, 9.81 * 0.01), rel=0.03)
    assert read.al.std() == pytest.approx(0.6, rel=0.03)
    assert read.rotor.std() == pytest.approx(3.0, rel=0.03)


def test_hanging_payload_pulls_with_its_weight():
    bob = Payload()
    f = tether_force(bob, np.array([0, 0, -0.8]), np.zeros(3), np.zeros(3), 9.81)
    np.testing.assert_allclose(f, [0, 0, -0.26 * 9.81], atol=1e-12)
    wrench = hook_wrench(Payload(hook=(0.1, 0.0, 0.0)), np.array([1.0, 0, 0, 0]), f)
    np.testing.assert_allclose(wrench[3:], [0, 0.26 * 9.81 * 0.1, 0], atol=1e-12)


def test_tether_never_pushes():
    f = tether_force(Payload(), np.array([0, 0, 0.8]), np.zeros(3), np.zeros(3), 9.81)
    np.testing.assert_allclose(f, 0.0)


def test_swing_matches_the_pendulum_equation():
    bob, angle, step = Payload(), 0.5, 0.01

    def rate(t, s):
        return [s[1], -9.81 / bob.length * np.sin(s[0])]

    t = step * (np.arange(100) + 0.5)
    phi, phi_rate = solve_ivp(rate, (0, 1), [angle, 0.0], t_eval=t, rtol=1e-9, atol=1e-9).y
    tension = bob.mass * (bob.length * phi_rate**2 + 9.81 * np.cos(phi))
    expected = np.stack([np.sin(phi) * tension, 0 * phi, -np.cos(phi) * tension], axis=1)
    r = bob.length * np.array([np.sin(angle), 0, -np.cos(angle)])
    found = swing(bob, r, np.zeros(3), np.zeros((100, 3)), step, 9.81)
    np.testing.assert_allclose(found, expected, atol=5e-3)  # [N]; second order in the step
