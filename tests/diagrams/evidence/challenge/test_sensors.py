"""Laws of the sensors, `clean` and `real`."""

import numpy as np
import pytest

from diagrams.evidence.challenge.sensors import (
    SensorQuality,
    draw_sensor_quality,
    flicker,
    gauss_markov,
    kept_rows,
    with_sensor_noise,
)
from np_drake import attitude
from np_drake.flight_log import FlightLog
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle

N = 40000


def still(tilt: float = 0.0) -> FlightLog:
    q = np.array([np.cos(tilt / 2), np.sin(tilt / 2), 0, 0])
    zero, four = np.zeros((N, 3)), np.zeros((N, 4))
    attitudes = np.tile(q, (N, 1))
    return FlightLog(0.01 * np.arange(N), zero, attitudes, zero, zero, four, zero, zero, four)


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def turn(q: np.ndarray, q_true: np.ndarray) -> np.ndarray:
    return 2 * attitude.multiply(q_true * [1, -1, -1, -1], q)[:, 1:]


def test_clean_noise_is_white_and_as_the_file_states():
    noise = MeasurementNoise(0.001, 0.01, 0.0, 0.02, 0.1, 0.5)
    vehicle, true = Vehicle(measurement_noise=noise), still()
    log = with_sensor_noise(true, vehicle, SensorQuality(), np.random.default_rng(0))
    figures = {"p": 0.001, "v": 0.01, "w": 0.02, "a": 0.1, "al": 0.5, "rotor": 2.0}
    for name, deviation in figures.items():
        error = getattr(log, name)
        assert rms(error) == pytest.approx(deviation, rel=0.03)
        assert abs(np.mean(error[1:] * error[:-1])) < 0.02 * deviation**2
    np.testing.assert_allclose(log.q, true.q, atol=1e-15)


def test_real_noise_has_the_figures_drawn():
    sensors = draw_sensor_quality("real", np.random.default_rng(1), 700.0)
    assert 0.005 <= sensors.attitude <= 0.010
    vehicle = Vehicle(measurement_noise=MeasurementNoise(attitude=0.005))
    log = with_sensor_noise(still(), vehicle, sensors, np.random.default_rng(2))
    assert log.al is None
    error = turn(log.q, still().q)
    assert rms(np.diff(error, axis=0)) / np.sqrt(2) == pytest.approx(sensors.attitude, rel=0.05)
    size = np.hypot(sensors.attitude, sensors.wander)
    assert rms(error) == pytest.approx(size, rel=0.2)  # slow: few samples
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
    x = gauss_markov(np.random.default_rng(0), t, rms=0.3, tau=0.5)
    assert rms(x) == pytest.approx(0.3, rel=0.05)
    assert np.mean(x[50:] * x[:-50]) / 0.09 == pytest.approx(np.exp(-1), abs=0.05)


def test_flicker_has_equal_power_in_every_decade():
    x = flicker(np.random.default_rng(0), 0.01 * np.arange(2**17), rms=1.0)
    power = np.abs(np.fft.rfft(x, axis=0)) ** 2
    f = np.fft.rfftfreq(len(x), 0.01)
    decades = [power[(f >= low) & (f < 10 * low)].sum() for low in (0.03, 0.3, 3.0)]
    assert rms(x) == pytest.approx(1.0, rel=0.1)
    assert max(decades) / min(decades) < 2.0


def test_clean_rows_are_all_there_and_real_ones_jitter():
    clean, rng = SensorQuality(), np.random.default_rng(0)
    np.testing.assert_allclose(np.diff(clean.instants(rng, 5.0)), 0.01, atol=1e-12)
    assert len(kept_rows(rng, clean, N)) == N
    real = np.diff(SensorQuality("real").instants(rng, 20.0))
    # Uniform, two instants.
    assert real.std() == pytest.approx(0.01 * 0.05 * np.sqrt(2 / 3), rel=0.1)


def test_lost_rows_are_single_and_have_their_share():
    rows = kept_rows(np.random.default_rng(1), SensorQuality("real", drops=0.03), 3000)
    assert len(rows) == 3000 - 90
    assert (rows[0], rows[-1]) == (0, 2999)
    lost = np.setdiff1d(np.arange(3000), rows)
    assert np.diff(lost).min() > 2
