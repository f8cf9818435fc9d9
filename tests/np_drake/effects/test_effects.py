import numpy as np

from np_drake.effects.base import Motion
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.pendulum import Payload, hook_wrench, tether_force
from np_drake.vehicle.vehicle import Vehicle

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


def test_lag_rests_where_the_thrust_equals_the_command():
    dut, thrust = MotorLag(0.03), np.array([1.0, 2.0, 3.0, 4.0])
    state = dut.state_at(VEHICLE, thrust)
    np.testing.assert_allclose(dut.state_rate(VEHICLE, state, thrust), 0.0, atol=1e-9)
    np.testing.assert_allclose(dut.thrust(VEHICLE, state, thrust), thrust)


def test_hanging_payload_pulls_with_its_weight():
    bob = Payload()
    f = tether_force(bob, np.array([0, 0, -0.8]), np.zeros(3), np.zeros(3), 9.81)
    np.testing.assert_allclose(f, [0, 0, -0.26 * 9.81], atol=1e-12)
    wrench = hook_wrench(Payload(hook=(0.1, 0.0, 0.0)), np.array([1.0, 0, 0, 0]), f)
    np.testing.assert_allclose(wrench[3:], [0, 0.26 * 9.81 * 0.1, 0], atol=1e-12)


def test_tether_never_pushes():
    f = tether_force(Payload(), np.array([0, 0, 0.8]), np.zeros(3), np.zeros(3), 9.81)
    np.testing.assert_allclose(f, 0.0)
