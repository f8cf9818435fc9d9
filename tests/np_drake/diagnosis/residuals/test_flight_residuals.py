"""Laws of the residuals of a flight against the nominal model."""

import dataclasses as dc
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from np_drake import attitude
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.residuals import flight_residuals as ev
from np_drake.diagnosis.residuals import low_pass, make_flight_residuals
from np_drake.diagnosis.residuals.rotor_thrust import Rotors
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.velocity_bias import VelocityBias
from np_drake.flight_log import FlightLog
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.opening import open_flights
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
INSIDE = slice(25, -25)  # of the grid: half a second from the ends


@pytest.mark.parametrize("accelerations", [True, False])
def test_a_nominal_flight_has_no_residual(seen, accelerations):
    dut = seen(accelerations=accelerations)
    np.testing.assert_allclose(dut.y[:, ev.WRENCH], 0.0, atol=1e-9)  # [N, N·m]
    np.testing.assert_allclose(dut.y[:, 6:12], 0.0, atol=1e-9)  # [m/s, m/s²]
    np.testing.assert_allclose(
        dut.y[:, ev.ATTITUDE], 0.0, atol=3e-3
    )  # rates between rows: second order [rad/s]


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


def test_without_accelerations_velocity_answers_the_command_before():
    bare = dc.replace(shaken(), a=None)
    np.testing.assert_allclose(make_flight_residuals(bare, VEHICLE).y, 0.0, atol=1e-9)
    swapped = dc.replace(bare, u=np.roll(bare.u, 1, axis=0))
    assert np.std(make_flight_residuals(swapped, VEHICLE).y[INSIDE, 2]) > 0.5  # [N]


@pytest.fixture
def lagging():
    """Return (vehicle, log) of rotors with lag that are commanded to hover in row 400."""
    vehicle = dc.replace(VEHICLE, rotor_time_constant=0.04)
    log = shaken()
    log.u[:400, 0] = 9.0
    f = Rotors(log, vehicle).thrust([])[0].sum(axis=1)
    a = np.stack([0 * f, 0 * f, f / VEHICLE.mass - VEHICLE.gravity], axis=1)
    return vehicle, dc.replace(log, a=a)


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


def test_what_a_lag_changes_until_the_next_row_is_in_its_trace(between):
    vehicle, log = between
    dut = make_flight_residuals(log, VEHICLE)
    assert np.std(dut.y[:, 11]) > 0.02  # [m/s²]
    trace = predicted_residual(dut, [Term(MotorLag(vehicle.rotor_time_constant))])
    np.testing.assert_allclose(dut.y, trace, atol=1e-9)


def test_what_rotors_did_before_the_log_began_is_no_residual(lagging):
    vehicle, log = lagging
    cut = log.rows(400, 800)
    dut = make_flight_residuals(cut, vehicle)
    assert dut.t[0] == pytest.approx(cut.t[0] + 7 * 0.04, abs=0.01)
    np.testing.assert_allclose(dut.y[:, 2], 0.0, atol=0.02)  # [N], e^-7 of what was missed


def test_a_log_begun_at_its_first_command_or_with_rotors_is_kept_whole(lagging):
    vehicle, log = lagging
    for kept in (log, dc.replace(log.rows(400, 800), input="rotor_speed")):
        assert make_flight_residuals(kept, vehicle).t[0] == kept.t[0]


def test_a_wrench_on_the_body_is_the_residual():
    log = shaken()
    pushed = dc.replace(
        log, u=log.u - [3.0, 0.1, -0.2, 0.05]
    )  # the rotors give less; the rest is from elsewhere
    found = make_flight_residuals(pushed, VEHICLE).y[:, ev.WRENCH]
    np.testing.assert_allclose(
        found, np.tile([0, 0, 3.0, 0.1, -0.2, 0.05], (len(found), 1)), atol=1e-9
    )


def test_kinematic_channels_show_velocity_that_is_not_positions_slope(seen):
    dut = seen(VelocityBias(0.1, -0.2, 0.3))
    expected = np.tile([-0.1, 0.2, -0.3], (len(dut.t), 1))
    np.testing.assert_allclose(dut.y[:, ev.POSITION], expected, atol=1e-3)


def test_noisy_attitude_is_seen_and_a_turned_acceleration_too(seen):
    clean, dut = seen(noise=0.3), seen(noise=0.3, attitude_noise=0.01)
    assert clean.attitude_noise < 1e-3
    assert not clean.turned
    assert dut.attitude_noise == pytest.approx(0.01, rel=0.1)
    assert dut.turned  # the made rig turns what it reads with the attitude that it reads
    np.testing.assert_allclose(
        dut.y[INSIDE, ev.FORCE].std(axis=0), clean.y[INSIDE, ev.FORCE].std(axis=0), rtol=0.3
    )


def test_acceleration_is_turned_back_by_the_attitude_that_turned_it(fly):
    log, quiet = fly(noise=0.3, attitude_noise=0.01), fly(noise=0.3)
    dut = make_flight_residuals(dc.replace(log, a=quiet.a), VEHICLE)
    assert not dut.turned
    assert dut.y[INSIDE, ev.FORCE].std() < 0.1  # 20 N of weight times 10 mrad would be 0.2 N


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


def test_a_band_beyond_the_rate_changes_nothing():
    values = np.random.default_rng(0).normal(size=(100, 2))
    assert low_pass(values, 0.05, 9.5) is values


def test_attitude_on_the_grid_is_that_of_the_rows(seen):
    dut = seen()
    np.testing.assert_allclose(np.linalg.norm(dut.q, axis=1), 1.0)
    np.testing.assert_allclose(dut.q, dut.log.q[::2], atol=1e-12)
    np.testing.assert_allclose(dut.R_WB, attitude.rotation_matrix(dut.q))


@pytest.mark.parametrize("shocked", [(), range(146, 153)])
def test_the_head_of_a_flight_is_as_the_whole_is_there(seen, shocked):
    whole = seen(seconds=8.0)
    whole = dc.replace(whole, outliers=np.isin(np.arange(len(whole.t)), shocked))
    dut = whole.head(150)
    assert 150 < len(dut.t) < 200
    terms = [Term(MotorLag(0.05), {whole.name: 1.0}), Term(LinearDrag(0.3, 0.2, 0.1))]
    for of in (
        lambda e: e.bridged(e.y),
        lambda e: e.bridged(predicted_residual(e, terms)),
        lambda e: e.begun(2.0),
    ):
        np.testing.assert_allclose(of(dut)[:150], of(whole)[:150], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(dut.driving[:149], whole.driving[:149], atol=1e-12)


RATE_NOISE = 0.02  # [rad/s]


def lossy(seed: int, *, jitter: float = 0.0, loss: float = 0.0, path: Path) -> FlightLog:
    """Return a hover of 60 s at 100 Hz with gyro noise, as read from a file with jitter and lost
    rows.

    jitter: of the instants, of the interval [1].
    loss: how many of a hundred rows start a gap of four rows.
    """
    rng, n = np.random.default_rng(seed), 6000
    t = 0.01 * (np.arange(n) + jitter * rng.uniform(-1, 1, n))
    still, q = np.zeros((n, 3)), np.tile([1.0, 0, 0, 0], (n, 1))
    u = np.tile([VEHICLE.mass * VEHICLE.gravity, 0, 0, 0], (n, 1))
    log = FlightLog(
        t=t, p=still, q=q, v=still, w=RATE_NOISE * rng.normal(size=(n, 3)), u=u, a=still
    )
    keep = np.ones(n, bool)
    for row in 10 * rng.choice(np.arange(1, n // 10 - 1), round(loss / 100 * n), replace=False):
        keep[row : row + 4] = False
    fields = {f.name: getattr(log, f.name) for f in dc.fields(log)}
    kept = {name: value[keep] for name, value in fields.items() if isinstance(value, np.ndarray)}
    write_log(dc.replace(log, **kept), path)
    return open_flights(path)[0][0]


@pytest.mark.parametrize("jitter, loss", [(0.0, 0.0), (0.3, 0.0), (0.0, 1.0), (0.3, 1.0)])
def test_gyro_noise_gives_torque_power_like_frequency_squared(tmp_path, jitter, loss):
    """The integral of torque is the change of rate, gaps included; where it is not, white slow
    torque shows.
    """
    power = 0.0
    for seed in range(2):
        log = lossy(seed, jitter=jitter, loss=loss, path=tmp_path / "a.csv")
        dut = make_flight_residuals(log, VEHICLE)
        frequency, own = signal.welch(dut.y[:, ev.TORQUE], 1 / dut.grid.step, nperseg=1000, axis=0)
        power = power + own
    slow, middle = ((frequency > a) & (frequency < b) for a, b in ((0.05, 1.0), (4.0, 8.0)))
    ratio = power[slow].sum(axis=0) / power[middle].sum(axis=0) / (1.0**3 / (8.0**3 - 4.0**3))
    assert (
        ratio.max() < 1.5
    )  # of 120 periodogram bins a sixth by chance, and a tenth for the width of the window


def test_a_constant_torque_seen_through_gaps_keeps_its_mean(tmp_path):
    log = lossy(0, jitter=0.3, loss=1.0, path=tmp_path / "a.csv")
    turning = dc.replace(log, w=0.1 * log.t[:, None] * [1.0, 0.0, 0.0])
    dut = make_flight_residuals(turning, VEHICLE)
    np.testing.assert_allclose(dut.y[:, 3], 0.1 * VEHICLE.J[0, 0], rtol=1e-6)  # of a grid of means


def test_rows_of_a_gap_are_no_outliers(tmp_path):
    dut = make_flight_residuals(lossy(0, loss=1.0, path=tmp_path / "a.csv"), VEHICLE)
    assert dut.log.bridged.any()
    assert not dut.outliers.any()


def test_the_head_of_a_flight_that_is_not_longer_is_the_flight(seen):
    whole = seen(seconds=8.0)
    assert whole.head(len(whole.t)) is whole
    all_outliers = dc.replace(whole, outliers=np.arange(len(whole.t)) > 100)
    assert all_outliers.head(150) is all_outliers
