import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.decision.infer import in_gusts
from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.gusts import as_gusts
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.result import Cause, Estimate
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)

DRAG = LinearDrag(0.3, 0.3, 0.3)


def felt_in(flights):
    return {e.name: e.y for e in flights}


def flown(seen, *effects, seconds=30.0, **how):
    return [seen(*effects, name=str(i), seed=i, noise=1.0, seconds=seconds, **how) for i in (1, 2)]


def cause(effect, **parameters) -> Cause:
    values = parameters or effect.values
    estimates = {n: Estimate(v, "", (v - 0.1, v + 0.1)) for n, v in values.items()}
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
    return flights, felt_in(flights)


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


def test_a_steady_wind_that_was_found_becomes_the_mean(blown):
    alone, beside = (
        as_gusts(*blown, [cause(DRAG), *winds], 0.9, IDEAL)
        for winds in ([], [cause(ConstantWind(2.0, -1.0, 0.5))])
    )
    assert [c.identifier for c in beside] == ["linear_drag", "gusty_wind"]
    assert beside[-1].parameters == alone[-1].parameters


def test_a_mean_wind_is_level_as_far_as_the_flights_do_not_tell(blown):
    flights, felt = blown
    upward = {n: y.copy() for n, y in felt.items()}
    for y in upward.values():
        y[:, 2] += 0.3 * 2.0
    sharp, vague = cause(DRAG), cause(DRAG, d_x=0.3, d_y=0.3, d_z=0.01)
    found = [
        as_gusts(flights, upward, [drag], 0.9, IDEAL)[-1].parameters["mean_z"]
        for drag in (sharp, vague)
    ]
    told = [e.value for e in found]
    assert 0.5 < told[0] < 2.0
    assert abs(told[1]) < 1.0  # through a drag as weak as this one it would be 60 m/s
    for e in found:
        assert e.ci95[1] - e.ci95[0] < 2 * np.hypot(
            1.96 * 0.5, 0.34 * e.value
        )  # of it and of the drag


def test_a_drag_that_is_hardly_known_widens_the_figures_of_the_wind(blown):
    sharp, vague = cause(DRAG), cause(DRAG)
    for name, estimate in sharp.parameters.items():
        sharp.parameters[name] = dc.replace(estimate, ci95=(0.299, 0.301))
    widths = []
    for drag in (sharp, vague):
        gusts = as_gusts(*blown, [drag], 0.9, IDEAL)[-1]
        widths.append([np.diff(gusts.parameters[name].ci95)[0] for name in ("mean_x", "deviation")])
    assert np.all(np.array(widths[1]) > 1.1 * np.array(widths[0]))


@pytest.mark.parametrize("options", [IDEAL, REAL])
def test_gusts_that_were_found_late_begin_where_their_power_does(seen, options):
    gusts, late = (
        GustyWind(0.0, 0.0, 0.0, 2.0, 0.5, seed=4),
        {"linear_drag": 8.0, "gusty_wind": 8.0},
    )
    flights = flown(seen, DRAG, gusts, seconds=16.0, onset=late)
    found = dc.replace(cause(DRAG), onset={"1": 9.0, "2": 9.0})
    for blown in as_gusts(flights, felt_in(flights), [found], 0.9, options):
        assert list(blown.onset.values()) == pytest.approx([8.0, 8.0], abs=0.15)


def test_a_drag_not_felt_before_the_wind_begins_with_it(seen):
    gusts, late = (
        GustyWind(0.0, 0.0, 0.0, 2.0, 0.5, seed=4),
        {"linear_drag": 8.0, "gusty_wind": 8.0},
    )
    flights = flown(seen, DRAG, gusts, seconds=16.0, onset=late)
    for blown in as_gusts(flights, felt_in(flights), [cause(DRAG)], 0.9, IDEAL):
        assert list(blown.onset.values()) == pytest.approx([8.0, 8.0], abs=0.15)


def test_a_drag_that_begins_with_wind_once_does_so_where_nothing_tells(seen):
    gusts, how = GustyWind(1.0, -0.5, 0.0, 1.0, 0.5, seed=4), {"noise": 1.0, "seconds": 16.0}
    begins = {"1": 8.0, "2": 5.0}
    flights = [
        seen(
            DRAG,
            gusts,
            name=n,
            seed=int(n),
            onset=dict.fromkeys(("linear_drag", "gusty_wind"), t),
            **how,
        )
        for n, t in begins.items()
    ]
    found = dc.replace(cause(DRAG), onset={"1": 8.0, "2": None})
    for blown in as_gusts(flights, felt_in(flights), [found], 0.9, IDEAL):
        assert list(blown.onset.values()) == pytest.approx(list(begins.values()), abs=0.15)


@pytest.mark.parametrize("held_out", [None, 3.0])
def test_an_unseen_flight_moves_nothing_in_the_fitted_ones(seen, held_out):
    gusts = GustyWind(0.0, 0.0, 0.0, 2.0, 0.5, seed=4)
    *flights, third = (
        seen(DRAG, gusts, name=n, seed=int(n), noise=1.0, seconds=16.0, onset={"gusty_wind": 8.0})
        for n in "123"
    )
    found = dc.replace(cause(DRAG), onset={"1": None, "2": None, "3": held_out})
    drag, wind = as_gusts(flights, felt_in([*flights, third]), [found], 0.9, IDEAL, [third])
    assert drag.onset == found.onset
    assert [wind.onset[n] for n in "12"] == pytest.approx([8.0, 8.0], abs=0.15)


def test_where_the_wind_begins_too_late_to_be_read_the_causes_stay(seen):
    flights = flown(seen, DRAG, seconds=8.0)
    found = dc.replace(cause(DRAG), onset={"1": 7.99, "2": 7.99})
    assert as_gusts(flights, felt_in(flights), [found], 0.9, REAL) == [found]


def test_a_drag_that_acts_from_the_start_does_so_before_gusts(seen):
    gusts = GustyWind(0.0, 0.0, 0.0, 2.0, 0.5, seed=4)
    flights = flown(seen, DRAG, gusts, seconds=16.0, onset={"gusty_wind": 8.0})
    drag, wind = as_gusts(flights, felt_in(flights), [cause(DRAG)], 0.9, IDEAL)
    assert drag.onset == {"1": None, "2": None}
    assert list(wind.onset.values()) == pytest.approx([8.0, 8.0], abs=0.15)


def test_unseen_gusts_begin_with_their_power_and_have_the_others_figures(seen):
    gusts, late = (
        GustyWind(0.0, 0.0, 0.0, 2.0, 0.5, seed=4),
        {"linear_drag": 8.0, "gusty_wind": 8.0},
    )
    flights = flown(seen, DRAG, gusts, seconds=16.0, onset=late)
    held_out = seen(DRAG, gusts, name="3", seed=3, noise=1.0, seconds=16.0, onset=late)
    felt = felt_in((*flights, held_out))
    found = dc.replace(cause(DRAG), onset={"1": 8.0, "2": 8.0, "3": 9.5})
    alone, (drag, beside) = (
        as_gusts(flights, felt, [found], 0.9, IDEAL, u) for u in ([], [held_out])
    )
    alone = alone[-1]
    assert list(beside.onset.values()) == pytest.approx([8.0, 8.0, 8.0], abs=0.15)
    assert drag.onset == beside.onset
    assert beside.parameters == alone.parameters


def test_without_a_drag_a_slow_force_stays_unnamed(blown):
    causes = [cause(ConstantWind())]
    assert as_gusts(*blown, causes, 0.9, IDEAL) == causes
    assert as_gusts(*blown, [], 0.9, IDEAL) == []


def test_of_gusts_the_mean_is_foreseen_in_the_place_of_a_steady_wind(seen):
    wind, gusts = ConstantWind(1.0, 0.0, 0.0), GustyWind(3.0, -1.0, 0.5, 2.0, 0.5)
    flight = seen(LinearDrag(0.3, 0.3, 0.3), ConstantWind(3.0, -1.0, 0.5), name="c", seed=5)
    terms = [Term(wind), Term(LinearDrag(0.1, 0.1, 0.1), {"c": None})]
    held = HeldOut(
        [flight], {"c": terms}, {"c": flight.y}, {"c": np.ones(len(flight.t), bool)}, {"c": terms}
    )
    causes = [
        Cause("linear_drag", 0.9, {}, {"c": None}, effect=LinearDrag(0.3, 0.3, 0.3)),
        Cause("gusty_wind", 0.9, {}, {"c": None}, effect=gusts),
    ]
    dut = in_gusts(held, causes)
    assert [t.effect.identifier for t in dut.terms["c"]] == ["linear_drag", "gusty_wind"]
    assert np.abs(dut.residual["c"][:, :6]).max() < 1e-3
    assert held.residual["c"] is flight.y
    late = [dc.replace(c, onset={"c": 4.0}) for c in causes]
    assert [t.begins("c") for t in in_gusts(held, late).terms["c"]] == [4.0, 4.0]
