import numpy as np
import pytest

from np_drake.diagnosis.decision.unexplained import burst_test, slow_torque, strongest_line
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


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_torque_that_comes_and_goes_is_seen(flights, axis):
    residual = left_of(flights)
    for e in flights:
        residual[e.name][:, 3 + axis] += 0.03 * (np.sin(2 * np.pi * 0.3 * e.t) > 0.5)  # [N·m]
    assert slow_torque(flights, residual)[0] > IDEAL.thresholds.slow_torque_ratio


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_burst_is_found_in_its_flight_at_its_time_and_size(flights, axis):
    residual = left_of(flights)
    struck = flights[1]
    residual["1"][:, axis] -= 3.0 * np.exp(-(((struck.t - 2.5) / 0.3) ** 2))
    dut = burst_test(flights, residual, REAL, 0.0)
    assert f"force {'xyz'[axis]}" in dut.finding.text
    assert "in 1 at" in dut.finding.text
    assert dut.finding.figures == {
        "time": pytest.approx(2.5, abs=0.1),
        "force": pytest.approx(3.0, rel=0.2),
    }
    assert dut.finding.size > REAL.thresholds.burst_ratio
    assert dut.probability > 0.5
