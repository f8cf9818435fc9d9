import numpy as np
import pytest

from np_drake import rigid_body
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.residual_model import Sample, WrenchForecast, constant_forecast
from np_drake.residual_models.hold import DisturbanceObserver, Hold
from np_drake.residual_models.oracle import TrueModel
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
LEVEL = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0, 0, 0, 0, 0, 0])
CHI = np.array([0.5, -0.3, -2.5, 0.01, -0.02, 0.005])


def samples(chi, n):
    """A body under hover thrust and a constant wrench, sampled every 20 ms."""
    x = LEVEL.copy()
    for _ in range(n):
        yield Sample(x, VEHICLE.hover_input, chi)
        for _ in range(20):
            x = x + 0.001 * rigid_body.state_derivative(VEHICLE, x, VEHICLE.hover_input, CHI)
        x[3:7] /= np.linalg.norm(x[3:7])


def test_hold_forecasts_the_last_label_everywhere():
    dut = Hold(step=0.02)
    memory = dut.update(dut.initial_memory(), Sample(LEVEL, np.zeros(4), CHI))
    chi = dut.forecast(memory, horizon=5, stride=2).rollout(np.zeros((5, 6)))
    np.testing.assert_allclose(chi, np.tile(CHI, (5, 1)))


def test_hold_keeps_the_last_label_where_one_is_missing():
    dut = Hold(step=0.02)
    memory = dut.update(dut.initial_memory(), Sample(LEVEL, np.zeros(4), CHI))
    after = dut.update(memory, Sample(LEVEL, np.zeros(4), np.full(6, np.nan)))
    np.testing.assert_array_equal(after["chi"], CHI)


def test_hold_with_a_bandwidth_rises_by_63_percent_in_one_time_constant():
    dut = Hold(
        step=0.02, force_bandwidth=1 / (2 * np.pi * 0.2), torque_bandwidth=1 / (2 * np.pi * 0.2)
    )
    memory = dut.update(dut.initial_memory(), Sample(LEVEL, np.zeros(4), np.zeros(6)))
    for _ in range(10):
        memory = dut.update(memory, Sample(LEVEL, np.zeros(4), CHI))
    np.testing.assert_allclose(memory["chi"], (1 - np.exp(-1)) * CHI, rtol=1e-9)


def test_observer_finds_a_constant_wrench_from_motion_and_command_alone():
    dut = DisturbanceObserver(VEHICLE, step=0.02)
    memory = dut.initial_memory()
    for sample in samples(np.full(6, np.nan), 25):
        memory = dut.update(memory, sample)
    np.testing.assert_allclose(
        memory["chi"][:3], CHI[:3], rtol=0.1, atol=0.05
    )  # [N]; the body turns


def test_a_gap_in_the_samples_makes_no_phantom_wrench():
    dut = DisturbanceObserver(VEHICLE, step=0.02)
    memory, lost = (
        dut.initial_memory(),
        Sample(np.full(13, np.nan), 0.5 * VEHICLE.hover_input, np.zeros(6)),
    )
    x = LEVEL.copy()
    for k in range(20):  # half a g of fall, as the model expects
        seen = Sample(x, 0.5 * VEHICLE.hover_input, np.zeros(6))
        memory = dut.update(memory, lost if 8 <= k < 13 else seen)
        x = x.copy()
        x[9] -= 0.5 * 9.81 * 0.02
    np.testing.assert_allclose(memory["chi"], 0.0, atol=1e-9)


def test_observer_waits_for_a_first_sample():
    dut = DisturbanceObserver(VEHICLE, step=0.02)
    memory = dut.update(dut.initial_memory(), Sample(np.full(13, np.nan), np.zeros(4), CHI))
    assert memory["started"][0] == 0.0


def test_forecast_rollout_is_the_recursion_written_out():
    rng = np.random.default_rng(0)
    A, B, C = rng.normal(size=(3, 3)) / 3, rng.normal(size=(3, 6)), rng.normal(size=(6, 3))
    z, zeta, offset = rng.normal(size=3), rng.normal(size=(3, 6)), rng.normal(size=(3, 6))
    chi = WrenchForecast(A, B, C, z, offset).rollout(zeta)
    np.testing.assert_allclose(chi[0], C @ z + offset[0])
    z2 = A @ (A @ z + B @ zeta[0]) + B @ zeta[1]
    np.testing.assert_allclose(chi[2], C @ z2 + offset[2])


def test_constant_forecast_ignores_the_motion():
    chi = constant_forecast(CHI, 4).rollout(np.random.default_rng(0).normal(size=(4, 6)))
    np.testing.assert_allclose(chi, np.tile(CHI, (4, 1)))


def test_oracle_adds_up_drag_and_missing_thrust():
    model = TrueModel(
        VEHICLE, None, [LinearDrag(0.2, 0.2, 0.2)], [MotorLag(0.03), ThrustScale(0.9)]
    )
    x = np.tile(LEVEL, (4, 1))
    x[:, 7] = 1.0
    thrust = 0.9 * np.full(4, VEHICLE.hover_input[0] / 4)
    u = np.tile(VEHICLE.hover_input, (3, 1))
    chi = model.wrench_along(x, u, 0.04, rotor_thrust=thrust, swing_state=None)
    expected = [-0.2 * np.sqrt(0.9), 0, -0.1 * VEHICLE.hover_input[0], 0, 0, 0]
    np.testing.assert_allclose(chi, np.tile(expected, (3, 1)), atol=1e-9)


def test_oracle_sees_the_lag_of_a_thrust_step():
    model = TrueModel(VEHICLE, None, [], [MotorLag(0.03)])
    u = np.tile([24.0, 0, 0, 0], (10, 1))
    chi = model.wrench_along(
        np.tile(LEVEL, (11, 1)), u, 0.04, rotor_thrust=np.full(4, 5.0), swing_state=None
    )
    assert chi[0, 2] < -1.0
    assert chi[-1, 2] == pytest.approx(0.0, abs=0.01)  # [N]


def test_both_poles_of_the_observers_error_are_those_of_its_bandwidth():
    """A constant force from rest: the error of its estimate follows D_(n+2) = 2 p D_(n+1) - p²
    D_n.
    """
    vehicle, step, bandwidth, force = Vehicle(), 0.02, 3.0, 1.5
    dut = DisturbanceObserver(vehicle, step=step, force_bandwidth=bandwidth)
    memory, x, errors = dut.initial_memory(), np.zeros(13), []
    x[3] = 1.0
    hover = np.array([vehicle.mass * vehicle.gravity, 0.0, 0.0, 0.0])
    for _ in range(12):
        memory = dut.update(memory, Sample(x.copy(), hover, np.zeros(6)))
        errors.append(force - memory["chi"][0])
        x[7] += step * force / vehicle.mass
    D, p = np.array(errors), np.exp(-2 * np.pi * bandwidth * step)
    np.testing.assert_allclose(D[2:], 2 * p * D[1:-1] - p**2 * D[:-2], atol=1e-12)
    assert D[1] == pytest.approx(force * (1 - (1 - p) ** 2))
