import numpy as np
import pytest

from np_drake.diagnosis.gusts import wind_force

DEVIATION, MEAN = 0.5, np.array([0.3, -0.2, 0.1])  # of `pushed`


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=str(i), seed=i, seconds=20.0) for i in (1, 2)]


@pytest.mark.parametrize("time", [0.3, 2.0])
def test_nine_of_ten_intervals_hold_the_truth(flights, time, pushed):
    inside = []
    for seed in range(20):
        dut = wind_force(flights, pushed(flights, np.random.default_rng(seed), time), {})
        for (value, low, high), true in ((dut.deviation, DEVIATION), (dut.correlation_time, time)):
            assert low < value < high
            inside.append(low < true < high)
        inside += list(np.abs(dut.mean[:, 0] - MEAN) < dut.mean[:, 1])
    assert 0.88 < np.mean(inside) <= 1.0


def test_before_its_onset_there_is_no_wind(flights, pushed):
    residual = pushed(flights, np.random.default_rng(1), 0.5, begin=8.0)
    late = wind_force(flights, residual, {"1": 8.0, "2": 8.0})
    assert late.deviation[1] < DEVIATION < late.deviation[2]
    assert np.all(np.abs(late.mean[:, 0] - MEAN) < late.mean[:, 1])
    assert wind_force(flights, residual, {}).deviation[0] < late.deviation[0]
