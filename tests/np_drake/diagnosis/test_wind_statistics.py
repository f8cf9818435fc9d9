import numpy as np
import pytest

from np_drake.diagnosis.force_bins import BIN
from np_drake.diagnosis.wind_statistics import WindForce, wind_force, wind_onset

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
    left = pushed(flights, np.random.default_rng(1), 0.5, begin=8.0)
    late = wind_force(flights, left, {"1": 8.0, "2": 8.0})
    assert late.deviation[1] < DEVIATION < late.deviation[2]
    assert np.all(np.abs(late.mean[:, 0] - MEAN) < late.mean[:, 1])
    assert wind_force(flights, left, {}).deviation[0] < late.deviation[0]


@pytest.mark.parametrize("taken_for", [7.0, 8.0, 9.5, 16.0, np.inf])
@pytest.mark.parametrize("mean", [0.0, 1.0])
def test_gusts_begin_where_their_power_does_whatever_their_mean(flights, taken_for, mean, pushed):
    left = pushed(flights, np.random.default_rng(1), 0.5, begin=8.0)
    steady = np.stack([mean * MEAN, np.zeros(3)], axis=1)
    wind = WindForce(steady, (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), 0.03)
    for e in flights:
        assert wind_onset(e, left[e.name], taken_for, wind) == pytest.approx(8.0, abs=2 * BIN)


@pytest.mark.parametrize("mean", [0.0, 1.0])
def test_gusts_that_begin_in_flight_are_told_from_gusts_from_the_start(flights, mean, pushed):
    steady = np.stack([mean * MEAN, np.zeros(3)], axis=1)
    wind = WindForce(steady, (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), 0.03)
    for seed in range(8):
        late, always = (pushed(flights, np.random.default_rng(seed), 0.5, begin=b) for b in (8.0, -np.inf))
        for e in flights:
            assert wind_onset(e, late[e.name], None, wind) == pytest.approx(8.0, abs=2 * BIN)
            assert wind_onset(e, always[e.name], None, wind) is None
            assert wind_onset(e, always[e.name], 9.0, wind) is None


def test_an_onset_stays_where_another_gains_little(flights, pushed):
    rng = np.random.default_rng(1)
    left = pushed(flights, rng, 0.5, begin=8.0)
    wind = WindForce(np.zeros((3, 2)), (0.1 * DEVIATION, 0.03, 0.07), (0.5, 0.3, 0.8), 0.05)
    for e in flights:
        noise = 0.05 * np.sqrt(BIN / e.grid.step) * rng.standard_normal((len(e.t), 3))
        faint = 0.1 * left[e.name]
        faint[:, :3] += noise
        assert wind_onset(e, faint, 8.3, wind) == 8.3


def test_gusts_that_are_absent_stay_so(flights, pushed):
    wind = WindForce(np.zeros((3, 2)), (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), 0.05)
    left = pushed(flights, np.random.default_rng(1), 0.5, begin=np.inf)
    for e in flights:
        assert wind_onset(e, left[e.name], np.inf, wind) == np.inf


@pytest.mark.parametrize("true", [1.2, 1.8, 17.0])
def test_an_onset_that_is_known_is_made_better_wherever_it_is(flights, true, pushed):
    left = pushed(flights, np.random.default_rng(2), 0.5, begin=true)
    wind = wind_force(flights, left, {e.name: true for e in flights})
    for e in flights:
        assert wind_onset(e, left[e.name], true + 1.0, wind) == pytest.approx(true, abs=2 * BIN)


def test_a_flight_may_have_a_mean_of_its_own(flights, pushed):
    for seed in range(6):
        left = pushed(flights, np.random.default_rng(seed), 0.2)
        wind = WindForce(np.full((3, 2), 1.0), (DEVIATION, 0.3, 0.7), (0.2, 0.1, 0.4), 0.05)
        for e in flights:
            assert wind_onset(e, left[e.name], None, wind) is None
