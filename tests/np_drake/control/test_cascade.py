import numpy as np
import pytest

from np_drake.control.cascade import AL, TARGET_SIZE, CascadeGains, P, W, cascade, cascade_target
from np_drake.references.base import Hover
from np_drake.references.harmonic import lemniscate
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
TRACK = lemniscate(length=1.5, width=0.75, height=1.6, speed=1.5, ramp=2.0)
REST = np.array([0, 0, 1.0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0])


def target(**parts) -> np.ndarray:
    out = np.zeros(TARGET_SIZE)
    out[2] = 1.0
    for name, value in parts.items():
        out[{"p": slice(0, 3), "v": slice(3, 6), "a": slice(6, 9), "yaw": 15}[name]] = value
    return out


def step(x=REST, integral=None, **parts):
    integral = np.zeros(6) if integral is None else integral
    return cascade(
        VEHICLE, CascadeGains(), x=x, target=target(**parts), integral=integral, step=0.01
    )


def test_at_rest_on_target_it_carries_the_weight():
    u, integral = step()
    np.testing.assert_allclose(u, VEHICLE.hover_input, atol=1e-12)
    np.testing.assert_allclose(integral, 0.0)


def test_wanted_acceleration_is_fed_forward():
    u, _ = step(a=[0, 0, 2.0])
    assert u[0] == pytest.approx(VEHICLE.mass * (9.81 + 2.0))


@pytest.mark.parametrize(
    "where, torque, sign", [([1.0, 0, 1], 2, 1), ([-1.0, 0, 1], 2, -1), ([0, 1.0, 1], 1, -1)]
)
def test_it_tilts_towards_the_target(where, torque, sign):
    u, _ = step(p=where)
    assert sign * u[torque] > 0.01  # [N·m]


@pytest.mark.parametrize("axis", range(3))
def test_a_turn_is_taken_back_about_its_axis(axis):
    x = REST.copy()
    x[3:7] = [np.cos(0.1), *np.sin(0.1) * np.eye(3)[axis]]
    assert step(x=x)[0][1 + axis] < -0.01  # [N·m]


def test_both_signs_of_a_quaternion_are_one_attitude():
    other = REST.copy()
    other[3:7] *= -1
    np.testing.assert_allclose(step(x=other, p=[1, 0, 1])[0], step(p=[1, 0, 1])[0], atol=1e-12)


def test_the_integral_remembers_the_error():
    _, integral = step(p=[0.1, 0, 1])
    np.testing.assert_allclose(integral[:3], [0.001, 0, 0], atol=1e-12)  # 0.1 m for 0.01 s
    assert step(integral=np.array([0, 0, 0.1, 0, 0, 0]))[0][0] > VEHICLE.hover_input[0]


def test_rotors_get_no_more_than_they_can_give():
    u, _ = step(p=[50.0, 50.0, 50.0])
    rotors = VEHICLE.unmixer @ u
    assert rotors.min() >= -1e-9
    assert rotors.max() <= VEHICLE.max_rotor_thrust + 1e-9


def test_a_hover_asks_for_nothing_but_its_position():
    target = cascade_target(Vehicle(), Hover(np.array([1.0, 2.0, 3.0])).sample(np.zeros(2)))
    expected = np.zeros((2, TARGET_SIZE))
    expected[:, P] = [1.0, 2.0, 3.0]
    np.testing.assert_allclose(target, expected, atol=1e-12)  # rounding


def test_the_angular_acceleration_is_the_derivative_of_the_rate():
    h = 1e-4  # [s]
    target = cascade_target(Vehicle(), TRACK.sample(3.0 + h * np.array([-1.0, 0.0, 1.0])))
    slope = (target[2, W] - target[0, W]) / (2 * h)
    np.testing.assert_allclose(target[1, AL], slope, atol=1e-4)  # of central differences [rad/s²]
