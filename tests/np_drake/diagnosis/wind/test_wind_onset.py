import numpy as np
import pytest

from np_drake.diagnosis.gusts import BIN, WindForce, still_air_loss, wind_force, wind_onset
from np_drake.diagnosis.options import Options

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)


DEVIATION, MEAN = 0.5, np.array([0.3, -0.2, 0.1])  # of `pushed`


RIG = REAL


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=str(i), seed=i, seconds=20.0) for i in (1, 2)]


def begin_of(e, residual, taken_for, wind, options=IDEAL):
    calm = still_air_loss(e, residual, wind, options)
    return wind_onset(e, residual, taken_for, wind, calm, options.priors.onset_gain)[0]


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
