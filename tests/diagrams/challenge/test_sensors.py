"""Laws of the sensors: `clean`, `real`, and `wild`, three times the range of `real` and any input
that tells the effects drawn.
"""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.challenge.draw import CaseDraw, draw_case
from diagrams.challenge.sensors import (
    COMMAND_TIME,
    FINER,
    LONGEST_DROP,
    OFF,
    RANGES,
    RATES,
    ROTOR,
    SEMANTICS,
    TIMING,
    LoggedInput,
    SensorQuality,
    as_logged,
    draw_logged_input,
    draw_sensor_quality,
    flicker,
    gauss_markov,
    kept_rows,
    with_sensor_noise,
)
from np_drake import attitude
from np_drake.effects.library import LIBRARY, unobservable
from np_drake.flight_log import FlightLog
from np_drake.logs.columns import LONGEST_GAP
from np_drake.vehicle.vehicle import INPUTS, MeasurementNoise, Vehicle

N = 40000
SPIN = 700.0  # [rad/s]


def still(tilt: float = 0.0) -> FlightLog:
    q = np.array([np.cos(tilt / 2), np.sin(tilt / 2), 0, 0])
    zero = np.zeros((N, 3))
    return FlightLog(
        0.01 * np.arange(N),
        zero,
        np.tile(q, (N, 1)),
        zero,
        zero,
        np.zeros((N, 4)),
        zero,
        zero,
        np.zeros((N, 4)),
    )


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def turn(q: np.ndarray, q_true: np.ndarray) -> np.ndarray:
    return 2 * attitude.multiply(q_true * [1, -1, -1, -1], q)[:, 1:]


def test_clean_noise_is_white_and_as_the_file_states():
    noise = MeasurementNoise(0.001, 0.01, 0.0, 0.02, 0.1, 0.5)
    log, true = (
        with_sensor_noise(
            still(), Vehicle(measurement_noise=noise), SensorQuality(), np.random.default_rng(0)
        ),
        still(),
    )
    figures = {"p": 0.001, "v": 0.01, "w": 0.02, "a": 0.1, "al": 0.5, "rotor": 2.0}
    for name, deviation in figures.items():
        error = getattr(log, name)
        assert rms(error) == pytest.approx(deviation, rel=0.03)
        assert abs(np.mean(error[1:] * error[:-1])) < 0.02 * deviation**2
    np.testing.assert_allclose(log.q, true.q, atol=1e-15)


def test_real_noise_has_the_figures_drawn():
    sensors = draw_sensor_quality("real", np.random.default_rng(1), 700.0)
    assert 0.005 <= sensors.attitude <= 0.010
    vehicle = Vehicle(measurement_noise=sensors.stated_noise())
    log = with_sensor_noise(still(), vehicle, sensors, np.random.default_rng(2))
    assert log.al is None
    error = turn(log.q, still().q)
    assert rms(np.diff(error, axis=0)) / np.sqrt(2) == pytest.approx(sensors.attitude, rel=0.05)
    assert rms(error) == pytest.approx(
        np.hypot(sensors.attitude, sensors.wander), rel=0.2
    )  # slow: few samples
    assert rms(log.v) == pytest.approx(np.hypot(0.01, sensors.velocity_wander), rel=0.1)
    assert rms(log.w) == pytest.approx(np.hypot(0.01, sensors.rate_flicker), rel=0.1)


@pytest.mark.parametrize("turned", [True, False])
def test_a_turned_accelerometer_sees_gravity_through_the_attitudes_error(turned):
    sensors = SensorQuality("real", attitude=0.008, turned=turned)
    vehicle = Vehicle(measurement_noise=MeasurementNoise(acceleration=0.0))
    log = with_sensor_noise(still(0.3), vehicle, sensors, np.random.default_rng(0))
    expected = 9.81 * 0.008 if turned else 0.0
    assert rms(log.a[:, 1]) == pytest.approx(expected, rel=0.05, abs=1e-12)


def test_a_gauss_markov_process_has_its_size_and_memory():
    t = 0.01 * np.arange(200000)
    x = gauss_markov(np.random.default_rng(0), t, 2, rms=0.3, tau=0.5)
    assert rms(x) == pytest.approx(0.3, rel=0.05)
    assert np.mean(x[50:] * x[:-50]) / 0.09 == pytest.approx(np.exp(-1), abs=0.05)


def test_flicker_has_equal_power_in_every_decade():
    x = flicker(np.random.default_rng(0), 0.01 * np.arange(2**17), 4, rms=1.0)
    power = np.abs(np.fft.rfft(x, axis=0)) ** 2
    f = np.fft.rfftfreq(len(x), 0.01)
    decades = [power[(f >= low) & (f < 10 * low)].sum() for low in (0.03, 0.3, 3.0)]
    assert rms(x) == pytest.approx(1.0, rel=0.1)
    assert max(decades) / min(decades) < 2.0


@pytest.fixture(scope="module")
def drawn():
    return [draw_sensor_quality("wild", np.random.default_rng(seed), SPIN) for seed in range(400)]


def spans(values, low, high):
    """Whether all values lie within the bounds, and come near both."""
    values = np.log(np.array(values))
    edge = 0.03 * (np.log(high) - np.log(low))  # 400 draws leave no twentieth of a range empty
    return (
        np.log(low) - 1e-9 <= values.min() <= np.log(low) + edge
        and np.log(high) - edge <= values.max() <= np.log(high) + 1e-9
    )


def test_rows_are_lost_in_succession_and_no_reader_refuses_the_gaps():
    sensors = dc.replace(
        draw_sensor_quality("wild", np.random.default_rng(0), SPIN),
        rate=RATES[0],
        drops=0.03,
        jitter=0.15,
    )
    rng = np.random.default_rng(1)
    t, rows = sensors.instants(rng, 60.0), kept_rows(rng, sensors, 3000)
    assert len(rows) == 3000 - 90
    assert rows[0] == 0
    assert rows[-1] == 2999
    assert set(np.diff(rows)) == set(range(1, LONGEST_DROP + 2))
    assert np.diff(t[rows]).max() < LONGEST_GAP


def test_every_input_and_every_meaning_of_a_command_occurs():
    dut = [draw_logged_input(np.random.default_rng(seed), ("linear_drag",)) for seed in range(200)]
    assert {logged.kind for logged in dut} == set(INPUTS)
    assert {logged.semantics for logged in dut} == set(SEMANTICS)
    assert {logged.late for logged in dut} == set(range(FINER))
    assert {logged.finer for logged in dut} == {1, FINER}


@pytest.mark.parametrize("name", LIBRARY)
def test_the_input_tells_the_effects_that_are_drawn(name):
    for seed in range(30):
        dut = draw_logged_input(np.random.default_rng(seed), (name, "gyro_bias"))
        assert name not in unobservable(dut.kind)
        if name in COMMAND_TIME:
            assert dut.semantics == "held_after"


def test_a_vehicle_file_says_held_where_commands_are_held_and_only_there():
    dut = [draw_case(CaseDraw(k, "clean"), quality="wild", seed=4, seconds=5.0) for k in range(30)]
    for case in dut:
        held = case.input.semantics == "held_after" and case.input.kind != "rotor_speed"
        assert (case.vehicle.command_timing == "held") is held
    assert {case.vehicle.command_timing for case in dut} == {"held", "unknown"}
    assert all(case.quality.rotor > 0 for case in dut if case.input.kind == "rotor_speed")
    real = draw_case(CaseDraw(0, "clean"), quality="real", seed=4, seconds=5.0)
    assert real.vehicle.command_timing == "held"
    assert real.input == LoggedInput()


def counted(t):
    """A log at rest whose commands are their own times."""
    three, four = np.zeros((len(t), 3)), np.tile(t[:, None], (1, 4))
    return FlightLog(t, three, four, three, three, four)


def test_a_row_holds_the_command_that_its_meaning_says():
    log = counted(0.01 * np.arange(8))
    u = log.u[:, 0]
    assert np.array_equal(as_logged(log, "held_after", 1).u[:, 0], u)
    assert np.array_equal(as_logged(log, "held_before", 1).u[1:, 0], u[:-1])
    assert np.allclose(as_logged(log, "averaged", 2).u[:, 0], 0.5 * (u[::2] + u[1::2]))
    assert np.array_equal(as_logged(log, "sampled", 2).u[:, 0], u[::2])


def test_a_late_sample_is_the_second_command_of_its_row():
    t = np.arange(0.0, 3.0, 0.02)
    dut = LoggedInput(semantics="sampled", late=1)
    fine = dut.instants(t)
    np.testing.assert_allclose(fine[::FINER], t)
    np.testing.assert_allclose(np.diff(fine), 0.01)
    log = as_logged(counted(fine), dut.semantics, dut.finer, dut.late)
    assert np.array_equal(log.u[:, 0], fine[1::FINER])


@pytest.mark.parametrize("kind", INPUTS)
@pytest.mark.parametrize("semantics", SEMANTICS)
def test_a_log_states_when_its_commands_act_where_they_are_not_held(kind, semantics):
    dut = LoggedInput(kind, semantics).sheet(0.02)
    assert (dut is None) == (semantics == "held_after" or kind == "rotor_speed")
    if dut is not None:
        assert dut.timing == pytest.approx(TIMING[semantics] * 0.02, abs=1e-6)
        assert (dut.content["command"] == semantics) == (semantics != "held_before")


def test_every_figure_of_wild_has_three_times_the_range_of_real(drawn):
    rng, stated = np.random.default_rng(0), SensorQuality("wild").stated_noise()
    real = [draw_sensor_quality("real", rng, SPIN) for _ in range(50)]
    for name, (low, high) in RANGES.items():
        assert spans([getattr(sensors, name) for sensors in drawn], low / 3, 3 * high)
        assert all(low <= getattr(sensors, name) <= high for sensors in real)
    for name in ("position", "velocity", "rate", "acceleration"):
        value = getattr(stated, name)
        assert spans([getattr(sensors.white, name) for sensors in drawn], value / 3, 3 * value)
    rotor = np.array([sensors.rotor for sensors in drawn])
    assert spans(np.abs(rotor), ROTOR * SPIN / 3, 3 * ROTOR * SPIN)
    assert np.mean(rotor < 0) == pytest.approx(0.5, abs=0.1)
    assert spans([sensors.rate for sensors in drawn], *RATES)
    for name in ("mass", "thrust"):
        off = np.array([getattr(sensors, f"{name}_off") for sensors in drawn])
        assert 2.9 * OFF < np.abs(off).max() <= 3 * OFF
        known = SensorQuality("wild").stated_uncertainty()[f"{name}_uncertainty"]
        assert off.std() == pytest.approx(known, rel=0.05)


def test_clean_rows_are_all_there_and_real_ones_jitter():
    clean, rng = SensorQuality(), np.random.default_rng(0)
    np.testing.assert_allclose(np.diff(clean.instants(rng, 5.0)), 0.01, atol=1e-12)
    assert len(kept_rows(rng, clean, N)) == N
    real = np.diff(SensorQuality("real").instants(rng, 20.0))
    # Uniform, two instants.
    assert real.std() == pytest.approx(0.01 * 0.05 * np.sqrt(2 / 3), rel=0.1)
