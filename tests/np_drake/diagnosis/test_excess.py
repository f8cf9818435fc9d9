import numpy as np
import pytest
from scipy import signal

from np_drake.diagnosis.excess import LINE, slow_torque, strongest_line
from np_drake.diagnosis.remains import SLOW_TORQUE


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=str(i), seed=i, noise=1.0) for i in range(3)]


def left_of(flights):
    return {e.name: e.y.copy() for e in flights}


@pytest.mark.parametrize("frequency", [1.7, 6.0])
@pytest.mark.parametrize("channel", [1, 4])
def test_a_line_is_found_at_its_frequency_and_size(flights, channel, frequency):
    left = left_of(flights)
    size = 1.0 * flights[0].y[:, channel].std()
    for i, e in enumerate(flights):  # every flight in its own phase
        left[e.name][:, channel] += np.sqrt(2) * size * np.sin(2 * np.pi * frequency * e.t + i)
    dut = strongest_line(flights, left)
    assert dut.channel == channel
    assert dut.frequency == pytest.approx(frequency, abs=0.1)
    assert dut.prominence > 2 * LINE
    assert dut.rms == pytest.approx(size, rel=0.4)


@pytest.mark.parametrize("seed", range(5))
def test_noise_alone_has_no_line_and_no_slow_torque(seen, seed):
    flights = [seen(name=str(i), seed=10 * seed + i, noise=1.0) for i in range(2)]
    assert strongest_line(flights, left_of(flights)).prominence < LINE
    assert slow_torque(flights, left_of(flights))[0] < 0.6 * SLOW_TORQUE[False]


@pytest.mark.parametrize("seed", range(5))
def test_a_force_that_wanders_has_no_line(flights, seed):
    """First-order noise of half a second: steep, and strongest where it is slowest."""
    left = left_of(flights)
    rng = np.random.default_rng(seed)
    keep = np.exp(-flights[0].grid.step / 0.5)
    for e in flights:
        left[e.name][:, :2] += signal.lfilter(
            [0.3 * np.sqrt(1 - keep**2)], [1, -keep], rng.normal(size=(len(e.t), 2)), axis=0
        )
    assert strongest_line(flights, left).prominence < LINE


@pytest.mark.parametrize("frequency", [0.5, 0.8])
def test_a_slow_line_is_found_as_well(flights, frequency):
    left = left_of(flights)
    for i, e in enumerate(flights):
        left[e.name][:, 0] += 5.0 * e.y[:, 0].std() * np.sin(2 * np.pi * frequency * e.t + i)
    dut = strongest_line(flights, left)
    assert dut.frequency == pytest.approx(frequency, abs=0.1)
    assert dut.prominence > LINE


def test_more_noise_is_no_more_slow_torque(flights):
    left = left_of(flights)
    louder = {n: 7.0 * y for n, y in left.items()}
    assert slow_torque(flights, louder)[0] == pytest.approx(slow_torque(flights, left)[0])


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_torque_that_comes_and_goes_is_seen(flights, axis):
    left = left_of(flights)
    for e in flights:
        left[e.name][:, 3 + axis] += 0.03 * (np.sin(2 * np.pi * 0.3 * e.t) > 0.5)  # [N·m]
    assert slow_torque(flights, left)[0] > SLOW_TORQUE[False]
