import numpy as np
import pytest

from np_drake.diagnosis.gusts import (
    BIN,
    WindForce,
    still_air_loss,
    wind_begins,
    wind_force,
    wind_onset,
)
from np_drake.diagnosis.options import Options

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)

DEVIATION, MEAN = 0.5, np.array([0.3, -0.2, 0.1])  # of `pushed`
RIG = REAL


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=str(i), seed=i, seconds=20.0) for i in (1, 2)]


def begin_of(e, residual, taken_for, wind, options=IDEAL):
    calm = still_air_loss(e, residual, wind, options)
    return wind_onset(e, residual, taken_for, wind, calm, options.priors.onset_gain).at


def wandering(e, rng, size=1.0):
    """(m, 15) of an attitude that errs as a rig's may, in tolerances, and of white noise."""
    step, scale = e.grid.step, size * e.vehicle.mass * e.vehicle.gravity * RIG.tolerance.attitude
    decay = np.exp(-step / REAL.priors.attitude_drift[0])
    force = [scale * rng.standard_normal(3)]
    for kick in rng.standard_normal((len(e.t) - 1, 3)):
        force.append(decay * force[-1] + scale * np.sqrt(1 - decay**2) * kick)
    residual = np.zeros((len(e.t), 15))
    residual[:, :3] = np.array(force) + 0.03 * np.sqrt(BIN / step) * rng.standard_normal(
        (len(e.t), 3)
    )
    return residual


@pytest.mark.parametrize("taken_for", [7.0, 8.0, 9.5, 16.0, np.inf])
@pytest.mark.parametrize("mean", [0.0, 1.0])
def test_gusts_begin_where_their_power_does_whatever_their_mean(flights, taken_for, mean, pushed):
    residual = pushed(flights, np.random.default_rng(1), 0.5, begin=8.0)
    steady = np.stack([mean * MEAN, np.zeros(3)], axis=1)
    wind = WindForce(steady, (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), 0.03)
    for e in flights:
        assert begin_of(e, residual[e.name], taken_for, wind) == pytest.approx(8.0, abs=2 * BIN)


@pytest.mark.parametrize("mean", [0.0, 1.0])
def test_gusts_that_begin_in_flight_are_told_from_gusts_from_the_start(flights, mean, pushed):
    steady = np.stack([mean * MEAN, np.zeros(3)], axis=1)
    wind = WindForce(steady, (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), 0.03)
    for seed in range(8):
        late, always = (
            pushed(flights, np.random.default_rng(seed), 0.5, begin=b) for b in (8.0, -np.inf)
        )
        for e in flights:
            assert begin_of(e, late[e.name], None, wind) == pytest.approx(8.0, abs=2 * BIN)
            assert begin_of(e, always[e.name], None, wind) is None
            assert begin_of(e, always[e.name], 9.0, wind) is None


def test_an_onset_stays_where_another_gains_little(flights, pushed):
    rng = np.random.default_rng(1)
    residual = pushed(flights, rng, 0.5, begin=8.0)
    wind = WindForce(np.zeros((3, 2)), (0.1 * DEVIATION, 0.03, 0.07), (0.5, 0.3, 0.8), 0.05)
    for e in flights:
        noise = 0.05 * np.sqrt(BIN / e.grid.step) * rng.standard_normal((len(e.t), 3))
        faint = 0.1 * residual[e.name]
        faint[:, :3] += noise
        assert begin_of(e, faint, 8.3, wind) == 8.3


def test_gusts_that_are_absent_stay_so(flights, pushed):
    wind = WindForce(np.zeros((3, 2)), (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), 0.05)
    residual = pushed(flights, np.random.default_rng(1), 0.5, begin=np.inf)
    for e in flights:
        assert begin_of(e, residual[e.name], np.inf, wind) == np.inf


@pytest.mark.parametrize("true", [1.2, 1.8, 17.0])
def test_an_onset_that_is_known_is_made_better_wherever_it_is(flights, true, pushed):
    residual = pushed(flights, np.random.default_rng(2), 0.5, begin=true)
    wind = wind_force(flights, residual, {e.name: true for e in flights})
    for e in flights:
        assert begin_of(e, residual[e.name], true + 1.0, wind) == pytest.approx(true, abs=2 * BIN)


def test_a_flight_may_have_a_mean_of_its_own(flights, pushed):
    for seed in range(6):
        residual = pushed(flights, np.random.default_rng(seed), 0.2)
        wind = WindForce(np.full((3, 2), 1.0), (DEVIATION, 0.3, 0.7), (0.2, 0.1, 0.4), 0.05)
        for e in flights:
            assert begin_of(e, residual[e.name], None, wind) is None


@pytest.mark.parametrize("size", [0.5, 1.0, 2.0])
def test_on_a_rig_gusts_begin_with_their_power_beside_an_attitude_drift(flights, size, pushed):
    for seed in range(4):
        rng = np.random.default_rng(seed)
        residual = pushed(flights, rng, 0.5, begin=8.0)
        residual = {e.name: residual[e.name] + wandering(e, rng, size) for e in flights}
        begins = wind_begins(flights, residual, {}, RIG)
        assert list(begins.values()) == pytest.approx([8.0, 8.0], abs=2 * BIN)


def test_on_a_rig_gusts_begin_with_their_power_in_a_long_flight(seen, pushed):
    flights, rng = [seen(name="1", seed=1, seconds=30.0)], np.random.default_rng(3)
    residual = pushed(flights, rng, 0.5, begin=25.0)
    residual = {e.name: residual[e.name] + wandering(e, rng) for e in flights}
    assert wind_begins(flights, residual, {}, RIG)["1"] == pytest.approx(25.0, abs=2 * BIN)


def test_on_a_rig_gusts_that_blow_throughout_begin_at_no_instant(flights, pushed):
    for seed in range(8):
        rng = np.random.default_rng(seed)
        residual = pushed(flights, rng, 0.5)
        residual = {e.name: residual[e.name] + wandering(e, rng) for e in flights}
        assert wind_begins(flights, residual, {}, RIG) == {"1": None, "2": None}


def test_an_attitude_that_errs_slowly_is_no_wind_in_a_flight_that_has_none(flights):
    wind = WindForce(np.zeros((3, 2)), (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), 0.03)
    for seed in range(8):
        for e in flights:
            residual = wandering(e, np.random.default_rng(seed))
            assert begin_of(e, residual, np.inf, wind, RIG) == np.inf


@pytest.mark.parametrize("options", [IDEAL, RIG])
def test_a_wind_makes_a_calm_less_likely_from_its_begin_on(flights, options, pushed):
    wind = WindForce(np.zeros((3, 2)), (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), 0.03)
    e = flights[0]
    calm = wandering(e, np.random.default_rng(1))
    blown = calm + pushed(flights, np.random.default_rng(2), 0.5, begin=8.0)[e.name]
    dut, alone = (still_air_loss(e, residual, wind, options) for residual in (blown, calm))
    assert dut[-1] > alone[-1] + 100.0
    before = slice(0, int(7.9 / BIN))
    assert np.abs(dut - alone)[before].max() < 0.1 * (dut - alone)[-1]
