"""Laws of the residuals of a flight against the nominal model."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.residuals import flight_residuals as ev
from np_drake.diagnosis.residuals import low_pass, make_flight_residuals
from np_drake.diagnosis.residuals.rotor_thrust import Rotors
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
INSIDE = slice(25, -25)  # of the grid: half a second from the ends


@pytest.mark.parametrize("accelerations", [True, False])
def test_a_nominal_flight_has_no_residual(seen, accelerations):
    dut = seen(accelerations=accelerations)
    np.testing.assert_allclose(dut.y[:, ev.WRENCH], 0.0, atol=1e-9)  # [N, N·m]
    np.testing.assert_allclose(dut.y[:, 6:12], 0.0, atol=1e-9)  # [m/s, m/s²]
    # rates between rows: second order [rad/s]
    np.testing.assert_allclose(dut.y[:, ev.ATTITUDE], 0.0, atol=3e-3)


def shaken(rows: int = 800, *, late: int = 0) -> FlightLog:
    """Return a level flight whose thrust changes in every row; `late`: rows by which its
    acceleration is delayed.
    """
    t = 0.01 * np.arange(rows)
    f = 19.62 + np.random.default_rng(0).normal(scale=2.0, size=rows)
    a = np.stack([0 * f, 0 * f, f / VEHICLE.mass - VEHICLE.gravity], axis=1)
    v = np.concatenate([np.zeros((1, 3)), 0.01 * np.cumsum(a[:-1], axis=0)])
    p = np.concatenate([np.zeros((1, 3)), 0.005 * np.cumsum(v[1:] + v[:-1], axis=0)])
    u = np.stack([f, 0 * f, 0 * f, 0 * f], axis=1)
    q, still = np.tile([1.0, 0, 0, 0], (rows, 1)), np.zeros((rows, 3))
    return FlightLog(t=t, p=p, q=q, v=v, w=still, u=u, a=np.roll(a, late, axis=0))


def test_each_acceleration_meets_the_command_of_its_own_row():
    np.testing.assert_allclose(make_flight_residuals(shaken(), VEHICLE).y, 0.0, atol=1e-9)
    for late in (-1, 1):
        y = make_flight_residuals(shaken(late=late), VEHICLE).y[INSIDE]
        assert np.std(y[:, 2]) > 0.5  # [N]


def test_rows_that_were_put_into_a_gap_do_not_count():
    log = shaken()
    assert not make_flight_residuals(log, VEHICLE).outliers.any()
    lost = (log.t > 2.995) & (log.t < 3.405)
    dut = make_flight_residuals(dc.replace(log, bridged=lost), VEHICLE)
    np.testing.assert_array_equal(dut.outliers, (dut.t > 2.985) & (dut.t < 3.415))


@pytest.fixture
def between():
    """Return (vehicle, log) of rotors with lag, whose thrust changes from row to row and between
    rows.
    """
    vehicle = dc.replace(VEHICLE, rotor_time_constant=0.04)
    log = shaken()
    at, until = (
        f.sum(axis=1) / vehicle.mass - vehicle.gravity for f in Rotors(log, vehicle).thrust([])
    )
    a, v = np.zeros((2, len(log), 3))
    a[:, 2], v[1:, 2] = at, 0.01 * np.cumsum(until)
    p = np.concatenate([np.zeros((1, 3)), 0.005 * np.cumsum(v[1:] + v[:-1], axis=0)])
    return vehicle, dc.replace(log, a=a, v=v, p=p)


def test_thrust_between_rows_sets_no_accelerometer_against_velocity(between):
    vehicle, log = between
    np.testing.assert_allclose(make_flight_residuals(log, vehicle).y, 0.0, atol=1e-9)


def test_a_wrench_on_the_body_is_the_residual():
    log = shaken()
    # the rotors give less; the rest is from elsewhere
    pushed = dc.replace(log, u=log.u - [3.0, 0.1, -0.2, 0.05])
    found = make_flight_residuals(pushed, VEHICLE).y[:, ev.WRENCH]
    np.testing.assert_allclose(
        found, np.tile([0, 0, 3.0, 0.1, -0.2, 0.05], (len(found), 1)), atol=1e-9
    )


def test_noisy_attitude_is_seen_and_a_turned_acceleration_too(seen):
    clean, dut = seen(noise=0.3), seen(noise=0.3, attitude_noise=0.01)
    assert clean.attitude_noise < 1e-3
    assert not clean.turned
    assert dut.attitude_noise == pytest.approx(0.01, rel=0.1)
    assert dut.turned  # the made rig turns what it reads with the attitude that it reads
    np.testing.assert_allclose(
        dut.y[INSIDE, ev.FORCE].std(axis=0), clean.y[INSIDE, ev.FORCE].std(axis=0), rtol=0.3
    )


def test_a_flight_shorter_than_three_seconds_is_refused_in_one_line(fly):
    with pytest.raises(ValueError, match="must last at least 3 s") as error:
        make_flight_residuals(fly(seconds=2.5, name="brief"), VEHICLE)
    assert "brief" in str(error.value)
    assert "\n" not in str(error.value)


def test_the_low_pass_keeps_the_slow_in_phase_and_removes_the_fast():
    t = 0.01 * np.arange(1000)
    slow, fast = np.sin(2 * np.pi * 0.5 * t), np.sin(2 * np.pi * 30 * t)
    found = low_pass(np.stack([slow, fast], axis=1), 0.01, 8.0)[100:-100]
    np.testing.assert_allclose(found[:, 0], slow[100:-100], atol=1e-3)
    assert np.abs(found[:, 1]).max() < 0.02
