import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.gusts import as_gusts, in_gusts, wind_onset
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.result import Cause, Estimate
from np_drake.diagnosis.slow_force import BIN, WindForce
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag

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


DEVIATION, MEAN = 0.5, np.array([0.3, -0.2, 0.1])  # of `pushed`


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=str(i), seed=i, seconds=20.0) for i in (1, 2)]


@pytest.mark.parametrize("taken_for", [7.0, 8.0, 9.5, 16.0, np.inf])
@pytest.mark.parametrize("mean", [0.0, 1.0])
def test_gusts_begin_where_their_power_does_whatever_their_mean(flights, taken_for, mean, pushed):
    residual = pushed(flights, np.random.default_rng(1), 0.5, begin=8.0)
    steady = np.stack([mean * MEAN, np.zeros(3)], axis=1)
    error = 0.01  # of an attitude that drifts [N]
    wind = WindForce(steady, (DEVIATION, 0.3, 0.7), (0.5, 0.3, 0.8), error, 5.0, 0.03)
    for e in flights:
        left = residual[e.name]
        onset, _ = wind_onset(e, left, left, wind, taken_for, IDEAL.priors.onset_gain)
        assert onset == pytest.approx(8.0, abs=2 * BIN)
