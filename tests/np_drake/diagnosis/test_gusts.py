import dataclasses as dc
from types import SimpleNamespace

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.gusts import (
    WIND_BIN,
    WindForce,
    as_gusts,
    binned,
    drags,
    factor,
    forces,
    in_gusts,
    instants,
    spans,
    still_air_loss,
    width,
    wind_force,
    wind_onset,
)
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.result import Cause, Estimate
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag
from tests.np_drake.diagnosis.simulated_flights import gauss_markov

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)
DRAG = LinearDrag(0.3, 0.3, 0.3)


def cause(effect) -> Cause:
    estimates = {n: Estimate(v, "", (v - 0.1, v + 0.1)) for n, v in effect.values.items()}
    return Cause(
        effect.identifier, 1.0, estimates, {"1": None, "2": None}, effect=effect, share=0.5
    )


@pytest.fixture(scope="module")
def blown(seen):
    """Two flights in gusts about a mean, and what drag and wind leave in them."""
    winds = [GustyWind(1.0, -0.5, 0.0, 1.5, 0.5, seed=seed) for seed in (1, 2)]
    flights = [
        seen(DRAG, wind, name=str(i), seed=i, noise=1.0, seconds=30.0)
        for i, wind in enumerate(winds, 1)
    ]
    return flights, {e.name: e.y for e in flights}


@pytest.mark.parametrize(
    "most, named", [(0.1, False), (0.3, True)]
)  # [N·s/m], for a force of 1.7 N
def test_gusts_that_need_more_wind_than_there_is_are_none(blown, most, named):
    weak = cause(LinearDrag(0.02, 0.02, 0.02))
    weak = dc.replace(
        weak, parameters={n: Estimate(0.02, "", (0.0, most)) for n in weak.parameters}
    )
    causes = as_gusts(*blown, [weak], 0.9, IDEAL)
    assert ("gusty_wind" in {c.identifier for c in causes}) is named


def test_through_a_drag_a_slow_force_is_a_wind_with_its_figures(blown):
    causes = as_gusts(*blown, [cause(DRAG)], 0.9, IDEAL)
    gusts = next(c for c in causes if c.identifier == "gusty_wind")
    assert [c.identifier for c in causes] == ["linear_drag", "gusty_wind"]
    true = {"mean_x": 1.0, "mean_y": -0.5, "mean_z": 0.0, "deviation": 1.5, "correlation_time": 0.5}
    for name, value in true.items():
        low, high = gusts.parameters[name].ci95
        assert low < value < high, name
        assert low < gusts.parameters[name].value < high
    assert gusts.probability == 0.9
    assert isinstance(gusts.effect, GustyWind)
    assert gusts.effect.deviation == gusts.parameters["deviation"].value
    assert gusts.onset == {"1": None, "2": None}


def test_of_gusts_the_mean_is_foreseen_in_the_place_of_a_steady_wind(seen):
    wind, gusts = ConstantWind(1.0, 0.0, 0.0), GustyWind(3.0, -1.0, 0.5, 2.0, 0.5)
    flight = seen(LinearDrag(0.3, 0.3, 0.3), ConstantWind(3.0, -1.0, 0.5), name="c", seed=5)
    terms = [Term(wind), Term(LinearDrag(0.1, 0.1, 0.1), {"c": None})]
    rows = {"c": np.ones(len(flight.t), bool)}
    held = HeldOut([flight], {"c": terms}, {"c": flight.y}, rows, {"c": terms}, effects=2)
    causes = [
        Cause("linear_drag", 0.9, {}, {"c": None}, effect=LinearDrag(0.3, 0.3, 0.3)),
        Cause("gusty_wind", 0.9, {}, {"c": None}, effect=gusts),
    ]
    dut = in_gusts(held, causes)
    assert [t.effect.identifier for t in dut.terms["c"]] == ["linear_drag", "gusty_wind"]
    assert np.abs(dut.residual["c"][:, :6]).max() < 1e-3
    assert len(dut.kept("c", ["linear_drag"])) == 1  # a gain is that of gusts alone
    assert held.residual["c"] is flight.y
    late = [dc.replace(c, onset={"c": 4.0}) for c in causes]
    assert [t.begins("c") for t in in_gusts(held, late).terms["c"]] == [4.0, 4.0]


def test_a_drag_that_is_hardly_known_widens_the_figures_of_the_wind(blown):
    sharp = cause(DRAG)
    known = {n: dc.replace(e, ci95=(0.299, 0.301)) for n, e in sharp.parameters.items()}
    widths = []
    for drag in (dc.replace(sharp, parameters=known), sharp):
        gusts = as_gusts(*blown, [drag], 0.9, IDEAL)[-1]
        widths.append([gusts.parameters[name].half for name in ("mean_x", "deviation")])
    assert np.all(np.array(widths[1]) > 1.1 * np.array(widths[0]))


def test_the_covariance_of_bins_is_that_of_averages():
    fine, time = 50, 0.25
    t = (np.arange(4 * fine) + 0.5) * WIND_BIN / fine
    exact = np.exp(-np.abs(t[:, None] - t) / time).reshape(4, fine, 4, fine).mean(axis=(1, 3))
    root = factor(4, WIND_BIN, 1.0, time, 0.0)
    np.testing.assert_allclose(root @ root.T, exact, atol=2e-4)


@pytest.mark.parametrize("step", [0.01, 0.02, 0.03, 0.04, 0.07, 0.2])
def test_bins_are_where_their_clock_says_at_every_rate(step):
    e = SimpleNamespace(
        t=3.0 + step * np.arange(round(5.0 / step)), grid=SimpleNamespace(step=step)
    )
    middle = instants(e) + 0.5 * (width(e) - step)
    np.testing.assert_allclose(binned(e, e.t[:, None])[:, 0], middle)
    (later,) = spans(e, instants(e)[:, None], 5.0)
    assert 5.0 <= later[0, 0] < 5.0 + width(e)


def test_the_force_of_a_drag_is_its_columns_times_its_figures(seen):
    e, d = seen(name="1", seed=1, seconds=8.0), (0.3, 0.2, 0.1)
    np.testing.assert_allclose(
        drags(e) @ d, forces(e, predicted_residual(e, [Term(LinearDrag(*d))])), atol=1e-9
    )


DEVIATION, MEAN = 0.5, np.array([0.3, -0.2, 0.1])  # of `pushed`


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=str(i), seed=i, seconds=20.0) for i in (1, 2)]


def begin_of(e, residual, taken_for, wind, options=IDEAL):
    calm = still_air_loss(e, residual, wind, options)
    return wind_onset(e, residual, taken_for, wind, calm, options.priors.onset_gain)[0]


def wandering(e, rng):
    """(m, 15) of an attitude that errs as a rig's may, in tolerances, and of white noise."""
    drift = gauss_markov(rng, e.t, REAL.priors.attitude_drift[0])
    white = 0.03 * np.sqrt(WIND_BIN / e.grid.step) * rng.standard_normal(drift.shape)
    residual = np.zeros((len(e.t), 15))
    residual[:, :3] = e.weight * REAL.tolerance.attitude * drift + white
    return residual


@pytest.mark.parametrize("taken_for", [7.0, 8.0, 9.5, 16.0, np.inf])
@pytest.mark.parametrize("mean", [0.0, 1.0])
def test_gusts_begin_where_their_power_does_whatever_their_mean(flights, taken_for, mean, pushed):
    residual = pushed(flights, np.random.default_rng(1), 0.5, begin=8.0)
    steady = np.stack([mean * MEAN, np.zeros(3)], axis=1)
    wind = WindForce(steady, (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), 0.03)
    for e in flights:
        assert begin_of(e, residual[e.name], taken_for, wind) == pytest.approx(
            8.0, abs=2 * WIND_BIN
        )


@pytest.mark.parametrize("options", [IDEAL, REAL])
def test_a_wind_makes_a_calm_less_likely_from_its_begin_on(flights, options, pushed):
    wind = WindForce(np.zeros((3, 2)), (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), 0.03)
    e = flights[0]
    calm = wandering(e, np.random.default_rng(1))
    blown = calm + pushed(flights, np.random.default_rng(2), 0.5, begin=8.0)[e.name]
    dut, alone = (still_air_loss(e, residual, wind, options) for residual in (blown, calm))
    assert dut[-1] > alone[-1] + 100.0
    before = slice(0, int(7.9 / WIND_BIN))
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
