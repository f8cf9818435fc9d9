import numpy as np
import pytest
from scipy import signal

from np_drake.diagnosis.decision.unexplained import slow_torque, strongest_burst, strongest_line
from np_drake.diagnosis.options import Options

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=str(i), seed=i, noise=1.0) for i in range(3)]


def left_of(flights):
    return {e.name: e.y.copy() for e in flights}


@pytest.mark.parametrize("frequency", [1.7, 6.0])
@pytest.mark.parametrize("channel", [1, 4])
def test_a_line_is_found_at_its_frequency_and_size(flights, channel, frequency):
    residual = left_of(flights)
    size = 1.0 * flights[0].y[:, channel].std()
    for i, e in enumerate(flights):  # every flight in its own phase
        residual[e.name][:, channel] += np.sqrt(2) * size * np.sin(2 * np.pi * frequency * e.t + i)
    dut = strongest_line(flights, residual)
    assert dut.channel == channel
    assert dut.frequency == pytest.approx(frequency, abs=0.1)
    assert dut.prominence > 2 * REAL.thresholds.line_ratio
    assert dut.rms == pytest.approx(size, rel=0.4)


@pytest.mark.parametrize("seed", range(5))
def test_noise_alone_has_no_line_and_no_slow_torque(seen, seed):
    flights = [seen(name=str(i), seed=10 * seed + i, noise=1.0) for i in range(2)]
    assert strongest_line(flights, left_of(flights)).prominence < REAL.thresholds.line_ratio
    assert slow_torque(flights, left_of(flights))[0] < 0.6 * IDEAL.thresholds.slow_torque_ratio


@pytest.mark.parametrize("seed", range(5))
def test_a_force_that_wanders_has_no_line(flights, seed):
    """First-order noise of half a second: steep, and strongest where it is slowest."""
    residual = left_of(flights)
    rng = np.random.default_rng(seed)
    keep = np.exp(-flights[0].grid.step / 0.5)
    for e in flights:
        residual[e.name][:, :2] += signal.lfilter(
            [0.3 * np.sqrt(1 - keep**2)], [1, -keep], rng.normal(size=(len(e.t), 2)), axis=0
        )
    assert strongest_line(flights, residual).prominence < REAL.thresholds.line_ratio


@pytest.mark.parametrize("frequency", [0.5, 0.8])
def test_a_slow_line_is_found_as_well(flights, frequency):
    residual = left_of(flights)
    for i, e in enumerate(flights):
        residual[e.name][:, 0] += 5.0 * e.y[:, 0].std() * np.sin(2 * np.pi * frequency * e.t + i)
    dut = strongest_line(flights, residual)
    assert dut.frequency == pytest.approx(frequency, abs=0.1)
    assert dut.prominence > REAL.thresholds.line_ratio


def test_more_noise_is_no_more_slow_torque(flights):
    residual = left_of(flights)
    louder = {n: 7.0 * y for n, y in residual.items()}
    assert slow_torque(flights, louder)[0] == pytest.approx(slow_torque(flights, residual)[0])


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_torque_that_comes_and_goes_is_seen(flights, axis):
    residual = left_of(flights)
    for e in flights:
        residual[e.name][:, 3 + axis] += 0.03 * (np.sin(2 * np.pi * 0.3 * e.t) > 0.5)  # [N·m]
    assert slow_torque(flights, residual)[0] > IDEAL.thresholds.slow_torque_ratio


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("time", [0.02, 0.5, 5.0])
def test_normal_noise_however_slow_bursts_nowhere(flights, seed, time):
    residual = left_of(flights)
    rng = np.random.default_rng(seed)
    keep = np.exp(-flights[0].grid.step / time)
    for e in flights:
        residual[e.name][:, :3] = signal.lfilter(
            [1.0], [1, -keep], rng.normal(size=(len(e.t), 3)), axis=0
        )
    assert strongest_burst(flights, residual).prominence < 0.8 * REAL.thresholds.burst_ratio


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_burst_is_found_in_its_flight_at_its_time_and_size(flights, axis):
    residual = left_of(flights)
    struck = flights[1]
    residual["1"][:, axis] -= 3.0 * np.exp(-(((struck.t - 2.5) / 0.3) ** 2))
    dut = strongest_burst(flights, residual)
    assert (dut.axis, dut.flight) == (axis, "1")
    assert dut.time == pytest.approx(2.5, abs=0.1)
    assert dut.size == pytest.approx(3.0, rel=0.2)
    assert dut.prominence > REAL.thresholds.burst_ratio


def test_more_noise_is_no_more_of_a_burst(flights):
    residual = left_of(flights)
    louder = {n: 7.0 * y for n, y in residual.items()}
    assert strongest_burst(flights, louder).prominence == pytest.approx(
        strongest_burst(flights, residual).prominence
    )


def test_without_any_force_nothing_bursts(flights):
    dut = strongest_burst(flights, {e.name: np.zeros_like(e.y) for e in flights})
    assert dut.prominence == dut.size == 0
