import numpy as np
import pytest

from np_drake import attitude
from np_drake.diagnosis.hidden_swing import attitude_on_grid
from np_drake.diagnosis.wind_statistics import (
    BIN,
    WindForce,
    _factor,
    chance_of_place,
    wind_force,
    wind_onset,
)

DEVIATION, MEAN = 0.5, np.array([0.3, -0.2, 0.1])


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=str(i), seed=i, seconds=20.0) for i in (1, 2)]


def process(rng, t, time):
    """(n, 3) first-order Gauss-Markov, exactly."""
    decay = np.exp(-np.diff(t) / time)
    out = [DEVIATION * rng.standard_normal(3)]
    for a in decay:
        out.append(a * out[-1] + DEVIATION * np.sqrt(1 - a**2) * rng.standard_normal(3))
    return np.array(out)


def pushed(flights, rng, time, *, begin=-np.inf, white=0.05):
    left = {}
    for e in flights:
        force = MEAN + process(rng, e.t, time) + white * rng.standard_normal((len(e.t), 3))
        left[e.name] = np.zeros_like(e.y)
        left[e.name][:, :3] = attitude.rotate_back(attitude_on_grid(e), force * (e.t >= begin)[:, None])
    return left


@pytest.mark.parametrize("time", [0.3, 2.0])
def test_nine_of_ten_intervals_hold_the_truth(flights, time):
    inside = []
    for seed in range(20):
        dut = wind_force(flights, pushed(flights, np.random.default_rng(seed), time), {})
        for (value, low, high), true in ((dut.deviation, DEVIATION), (dut.correlation_time, time)):
            assert low < value < high
            inside.append(low < true < high)
        inside += list(np.abs(dut.mean[:, 0] - MEAN) < dut.mean[:, 1])
    assert 0.88 < np.mean(inside) <= 1.0


def test_before_its_onset_there_is_no_wind(flights):
    left = pushed(flights, np.random.default_rng(1), 0.5, begin=8.0)
    late = wind_force(flights, left, {"1": 8.0, "2": 8.0})
    assert late.deviation[1] < DEVIATION < late.deviation[2]
    assert np.all(np.abs(late.mean[:, 0] - MEAN) < late.mean[:, 1])
    assert wind_force(flights, left, {}).deviation[0] < late.deviation[0]


@pytest.mark.parametrize("taken_for", [7.0, 8.0, 9.5, 16.0, np.inf])
@pytest.mark.parametrize("mean", [0.0, 1.0])
def test_gusts_begin_where_their_power_does_whatever_their_mean(flights, taken_for, mean):
    left = pushed(flights, np.random.default_rng(1), 0.5, begin=8.0)
    steady = np.stack([mean * MEAN, np.zeros(3)], axis=1)
    wind = WindForce(steady, (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), 0.03)
    for e in flights:
        assert wind_onset(e, left[e.name], taken_for, wind) == pytest.approx(8.0, abs=2 * BIN)


@pytest.mark.parametrize("mean", [0.0, 1.0])
def test_gusts_that_begin_in_flight_are_told_from_gusts_from_the_start(flights, mean):
    steady = np.stack([mean * MEAN, np.zeros(3)], axis=1)
    wind = WindForce(steady, (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), 0.03)
    for seed in range(8):
        late, always = (pushed(flights, np.random.default_rng(seed), 0.5, begin=b) for b in (8.0, -np.inf))
        for e in flights:
            assert wind_onset(e, late[e.name], None, wind) == pytest.approx(8.0, abs=2 * BIN)
            assert wind_onset(e, always[e.name], None, wind) is None
            assert wind_onset(e, always[e.name], 9.0, wind) is None


def test_an_onset_stays_where_another_gains_little(flights):
    left = pushed(flights, np.random.default_rng(1), 0.5, begin=8.0)
    faint = {n: 0.1 * y for n, y in left.items()}
    wind = WindForce(np.zeros((3, 2)), (0.1 * DEVIATION, 0.03, 0.07), (0.5, 0.3, 0.8), 0.05)
    for e in flights:
        assert wind_onset(e, faint[e.name], 8.3, wind) == 8.3


def test_gusts_that_are_absent_stay_so(flights):
    wind = WindForce(np.zeros((3, 2)), (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), 0.05)
    left = pushed(flights, np.random.default_rng(1), 0.5, begin=np.inf)
    for e in flights:
        assert wind_onset(e, left[e.name], np.inf, wind) == np.inf


def test_an_onset_too_near_the_end_to_look_about_stays(flights):
    wind = WindForce(np.zeros((3, 2)), (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), 0.03)
    e = flights[0]
    assert wind_onset(e, np.zeros_like(e.y), 99.0, wind) == 99.0


def test_twice_the_force_is_twice_the_wind_and_lasts_as_long(flights):
    left = pushed(flights, np.random.default_rng(2), 0.5)
    one, two = (wind_force(flights, {n: k * y for n, y in left.items()}, {}) for k in (1.0, 2.0))
    assert two.deviation == pytest.approx(2 * np.array(one.deviation), rel=1e-2)
    assert two.correlation_time == pytest.approx(one.correlation_time, rel=2e-2)
    assert two.mean == pytest.approx(2 * one.mean, rel=1e-2)


def test_the_covariance_of_bins_is_that_of_averages():
    fine, time = 50, 0.25
    t = (np.arange(4 * fine) + 0.5) * BIN / fine
    exact = np.exp(-np.abs(t[:, None] - t) / time).reshape(4, fine, 4, fine).mean(axis=(1, 3))
    factor = _factor(4, 1.0, time, 0.0)
    np.testing.assert_allclose(factor @ factor.T, exact, atol=2e-4)


def field(e, slope, normal):
    """(n, 3) force in W that grows along `normal`."""
    p = np.stack([np.interp(e.t, e.rows.t, axis) for axis in e.rows.x[:, :3].T], axis=1)
    return slope * (p @ normal)[:, None] * normal


def test_gusts_follow_the_place_as_often_as_chance_has_it(flights):
    found = []
    for seed in range(60):
        left = pushed(flights, np.random.default_rng(seed), 0.6)
        found.append(chance_of_place(flights, left, wind_force(flights, left, {})))
    assert 0.35 < np.mean(found) < 0.65
    assert np.mean(np.array(found) < 0.1) < 0.25


def test_a_force_tied_to_a_place_is_no_gust_whatever_its_mean_in_a_flight(flights):
    normal = np.array([0.8, 0.6, 0.0])
    left = pushed(flights, np.random.default_rng(3), 0.6)
    for i, e in enumerate(flights):
        tied = field(e, 1.0, normal) + 0.3 * i
        left[e.name] = 0.3 * left[e.name]
        left[e.name][:, :3] += attitude.rotate_back(attitude_on_grid(e), tied)
    assert chance_of_place(flights, left, wind_force(flights, left, {})) < 1e-6


def jet(e):
    """(n, 3) level force in W about the middle of a flight: it points one way on all sides."""
    p = np.stack([np.interp(e.t, e.rows.t, axis) for axis in e.rows.x[:, :3].T], axis=1)
    away = (p - p.mean(axis=0)) / p.std(axis=0)
    return np.exp(-0.5 * np.sum(away[:, :2] ** 2, axis=1))[:, None] * np.array([1.0, -0.5, 0.0])


def behind(e):
    """(n, 3) a drag's force in W."""
    return -0.3 * np.stack([np.interp(e.t, e.rows.t, axis) for axis in e.rows.x[:, 7:10].T], axis=1)


@pytest.mark.parametrize(("force", "tied"), [(jet, True), (behind, False)])
def test_a_force_beside_gusts_is_tied_to_the_place_where_the_velocity_does_not_tell_it(flights, force, tied):
    left = pushed(flights, np.random.default_rng(4), 0.6)
    for e in flights:
        left[e.name] = 0.3 * left[e.name]
        left[e.name][:, :3] += attitude.rotate_back(attitude_on_grid(e), force(e))
    chance = chance_of_place(flights, left, wind_force(flights, left, {}))
    assert chance < 1e-6 if tied else chance > 1e-2
