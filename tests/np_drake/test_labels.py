"""Laws of the wrench labels."""

import numpy as np
import pytest

from np_drake import labels as lb
from np_drake import rigid_body
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle

STEP = 0.01  # [s]


def flight(chi=(0.5, -0.3, -2.5, 0.01, -0.02, 0.005), *, n=400, lag=0.0, seed=0):
    """A log whose accelerations are exactly eq. (1) under a constant wrench."""
    vehicle = Vehicle(rotor_time_constant=lag).check()
    draw = np.random.default_rng(seed)
    q = draw.normal(size=(n, 4)) * 0.1 + [1, 0, 0, 0]
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    w = draw.normal(size=(n, 3))
    u = np.array([20.0, 0, 0, 0]) + draw.normal(size=(n, 4)) * [2.0, 0.1, 0.1, 0.02]
    t, p, v = STEP * np.arange(n), np.zeros((n, 3)), draw.normal(size=(n, 3))
    log = FlightLog(t, p, q, v, w, u, name="made")
    acting = lb.acting_command(log, vehicle)
    rate = rigid_body.state_derivative(vehicle, log.x, acting, np.broadcast_to(chi, (n, 6)))
    log.a, log.al = rate[:, 7:10], rate[:, 10:13]
    return vehicle, log, np.array(chi)


def stream(dut, log, u):
    memory, out = dut.initial_memory(), []
    for k in range(len(log)):
        memory, chi = dut.step(memory, x=log.x[k], a=log.a[k], al=log.al[k], u=u[k])
        out.append(chi)
    return np.array(out)


def test_a_constant_wrench_is_labelled_at_once_and_exactly():
    vehicle, log, chi = flight()
    # round-off [N, N·m]
    np.testing.assert_allclose(lb.labels(log, vehicle), np.tile(chi, (400, 1)), atol=1e-9)


@pytest.mark.parametrize("lag", [0.0, 0.03])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_streaming_form_equals_the_batch_form(lag, order):
    vehicle, log, _ = flight(lag=lag)
    log.a += np.random.default_rng(1).normal(size=log.a.shape)
    log.a[50], log.al[60:70], log.u[120] = np.nan, np.nan, np.nan
    config = lb.LabelConfig(force_bandwidth=5.0, torque_bandwidth=2.0, order=order)
    # A lagged rotor shows the command before; without lag, a and al are right-sided and show the
    # row's own.
    u = np.vstack([log.u[:1], log.u[:-1]]) if lag else log.u
    dut = lb.LabelFilter(vehicle, config, step=log.step)
    batch = lb.labels(log, vehicle, config)
    np.testing.assert_allclose(stream(dut, log, u), batch, atol=1e-9)  # round-off [N, N·m]
    assert np.isnan(batch).any(axis=1).sum() == 12


def test_a_first_order_label_answers_a_step_with_its_time_constant():
    vehicle, log, _ = flight(chi=np.zeros(6))
    log.a[200:, 0] += 1.0 / vehicle.mass
    log.al[200:, 2] += 1.0 / vehicle.J[2, 2]
    config = lb.LabelConfig(force_bandwidth=1.0, torque_bandwidth=0.5)
    after = lb.labels(log, vehicle, config)[200:]
    for channel, bandwidth in ((0, 1.0), (5, 0.5)):
        time = log.t[200:] - log.t[200] + STEP / 2
        expected = 1 - np.exp(-2 * np.pi * bandwidth * time)
        # bilinear against exact [N, N·m]
        np.testing.assert_allclose(after[:, channel], expected, atol=2e-3)


def test_smooth_labels_have_no_delay():
    vehicle, log, _ = flight(chi=np.zeros(6), n=1000)
    wave = np.sin(2 * np.pi * 0.5 * log.t)
    log.a[:, 0] += wave / vehicle.mass
    middle = slice(200, 800)
    chi = [method(log, vehicle)[middle, 0] for method in (lb.smooth_labels, lb.labels)]
    lag = [np.argmax(np.correlate(force, wave[middle], "full")) for force in chi]
    assert lag[0] == 599  # samples; zero shift of two 600-sample pieces
    assert lag[1] > 599


def test_a_command_through_the_vehicle_files_lag_leaves_no_torque():
    vehicle, log, _ = flight(chi=np.zeros(6), lag=0.03)
    assert np.abs(lb.raw_labels(log, vehicle)).max() < 1e-9  # [N, N·m]
    assert np.abs(lb.raw_labels(log, Vehicle())[:, 3:]).max() > 0.05  # without it [N·m]


def test_measured_rotor_speed_is_not_lagged_again():
    vehicle, log, _ = flight(lag=0.03)
    log.input = "rotor_speed"
    assert lb.acting_command(log, vehicle) is log.u


@pytest.mark.parametrize(
    "bad", [{"force_bandwidth": -1.0}, {"torque_bandwidth": np.nan}, {"order": 0}]
)
def test_an_impossible_filter_is_refused(bad):
    with pytest.raises(ValueError, match="LabelConfig"):
        lb.LabelConfig(**bad).check()
