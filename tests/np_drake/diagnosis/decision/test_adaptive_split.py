import copy
import dataclasses as dc
import gc
import importlib
import weakref
from functools import cache

import numpy as np
import pytest

from np_drake.diagnosis.adequacy.residual_tests import UNSEEN
from np_drake.diagnosis.decision import adaptive_split
from np_drake.diagnosis.decision.adaptive_split import (
    infer_adaptively,
    needs_split,
    plainly_needs_split,
    split_flights,
)
from np_drake.diagnosis.decision.compare import compare
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.fitting.map_estimate import Generic
from np_drake.diagnosis.forward_model.term import Term
from np_drake.diagnosis.held_out.adaptation import scored_rows
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals.flight_residuals import make_flight_residuals
from np_drake.diagnosis.result import Diagnosis, Finding
from np_drake.diagnosis.selection import map_model
from np_drake.diagnosis.selection.map_model import find_map_model
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.vehicle import Vehicle

infer_module = importlib.import_module(
    "np_drake.diagnosis.decision.infer"
)  # the package has a function so named

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)

DRAG = LinearDrag(0.6, 0.6, 0.0)
UP_AND_DOWN = (0.0, 0.0, 1.0, 0.0)


@pytest.fixture(scope="module", autouse=True)
def known_searches(searched):
    """Every search of the same flights is made once."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (adaptive_split, infer_module):
            patch.setattr(module, "find_map_model", searched)
        yield


@pytest.fixture(scope="module")
def logs(fly):
    """Two flights straight up and down to fit, one that moves sideways to judge; each is flown once."""

    @cache
    def flown(*effects):
        own = {"noise": 1.0, "seconds": 10.0}
        train = [fly(*effects, name=n, seed=i, vigour=UP_AND_DOWN, **own) for i, n in enumerate("ab", 1)]
        return train, [fly(*effects, name="c", seed=3, **own)]

    return flown


@pytest.fixture(scope="module")
def diagnosed(logs):
    """The answer of these flights; each is worked out once."""

    @cache
    def answer(*effects, adaptive_split: bool = True) -> Diagnosis:
        return diagnose(Vehicle(), *logs(*effects), adaptive_split=adaptive_split)

    return answer


def test_an_effect_that_training_does_not_excite_is_found_in_the_first_half_of_the_held_out_flight(diagnosed):
    dut = diagnosed(DRAG)
    assert dut.verdict == ("linear_drag",)
    assert dut.joined == ("c",)
    for axis in "xy":
        low, high = dut.causes[0].parameters[f"d_{axis}"].ci95
        assert low < 0.6 < high
    assert dut.shrink.fraction > 0.9
    assert any("c: " in w and "joined the fit" in w for w in dut.warnings)
    assert dut.as_json()["joined"] == ["c"]


def test_the_half_that_joins_is_no_flight_of_the_answer(diagnosed):
    dut = diagnosed(DRAG)
    assert (dut.train, dut.held_out) == (("a", "b"), ("c",))
    assert set(dut.causes[0].onset) == {"a", "b", "c"}


def test_where_training_cannot_tell_two_effects_the_held_out_flight_does(diagnosed):
    dut = diagnosed(ThrustScale(0.9))
    assert dut.verdict == ("thrust_scale",)
    assert dut.joined == ()  # it is asked, not fitted to


def test_a_force_that_unseen_flights_alone_show_asks_for_a_second_look_however_small_it_is(seen, searched):
    first = compare(*found(seen, searched, structured=False))
    assert not needs_split(first)
    novel_on_held_out = dc.replace(
        first, unexplained=dc.replace(first.unexplained, findings=(Finding(UNSEEN, "", 1.0),))
    )
    assert needs_split(novel_on_held_out)
    assert not needs_split(dc.replace(novel_on_held_out, gusty=True))


def test_without_a_second_look_nothing_of_the_held_out_flight_is_fitted(diagnosed):
    dut = diagnosed(DRAG, adaptive_split=False)
    assert dut.joined == ()
    assert "linear_drag" not in dut.verdict
    assert dut.shrink.fraction < 0.1


def test_what_training_gave_no_weight_is_not_sought_as_hung_on_in_flight(logs, searched, monkeypatch):
    hanging, sought = [], []

    def spy(flights, options=None, **how):
        hanging.append(how)
        return searched(flights, options, **how)

    monkeypatch.setattr(adaptive_split, "find_map_model", spy)
    assert diagnose(Vehicle(), *logs(DRAG)).joined == ("c",)
    assert hanging == [{}, {"hanging": False}]
    monkeypatch.setattr(map_model, "late_payloads", lambda problem, late: sought.append(late) or [])
    short = [make_flight_residuals(log.rows(0, 400), Vehicle()) for log in logs(DRAG)[0][:1]]
    find_map_model(short, hanging=False)
    assert sought == []
    find_map_model(short)
    assert len(sought) == 1


def found(seen, searched, *effects, seconds: float = 10.0, structured: bool = True, **held):
    """A best model, with structure that no effect explains in it, and unseen flights."""
    how = {"noise": 1.0, "seconds": seconds}
    flights = [seen(*effects, name=n, seed=i, vigour=UP_AND_DOWN, **how) for i, n in enumerate("ab", 1)]
    unseen = [seen(*effects, name="c", seed=3, **(how | held))]
    model = searched(flights)
    return (with_structure(model) if structured else model), unseen


def with_structure(model):
    structure = next(c for c in model.problem.candidates if c.generic)
    part = Generic(structure, np.zeros(structure.size))
    return dc.replace(model, best=dc.replace(model.best, generic=(part,)))


def test_where_the_best_model_plainly_shows_it_models_are_compared_once(logs, searched, monkeypatch):
    compared = []
    monkeypatch.setattr(adaptive_split, "compare", lambda *asked: compared.append(asked) or compare(*asked))
    assert diagnose(Vehicle(), *logs(DRAG)).joined == ("c",)
    assert [len(at.problem.flights) for at, _ in compared] == [2, 3]
    sought = []

    def structured(*of, **how):
        sought.append(how)
        return with_structure(searched(*of, **how))

    monkeypatch.setattr(adaptive_split, "find_map_model", structured)
    compared.clear()
    assert diagnose(Vehicle(), *logs(DRAG)).joined == ("c",)
    ((at, judges),) = compared
    assert [e.name for e in at.problem.flights] == ["a", "b", "first half of c"]
    assert [e.joined.any() for e in judges] == [True]
    assert sought == [{}, {"hanging": False}]


def test_what_a_first_look_was_found_from_is_forgotten_when_a_second_begins(logs, searched, monkeypatch):
    first, residual = [], []

    def watched(*of, **how):
        gc.collect()
        residual.extend(known() for known in first)
        found_now = searched(*of, **how)
        found_now = dc.replace(found_now, problem=copy.copy(found_now.problem))  # which nobody else keeps
        first.append(weakref.ref(found_now.problem))
        return found_now

    monkeypatch.setattr(adaptive_split, "find_map_model", watched)
    assert diagnose(Vehicle(), *logs(DRAG)).joined == ("c",)
    assert residual == [None]


def test_what_the_best_model_leaves_of_unseen_flights_is_plain_where_structure_is_in_it(
    seen, searched, monkeypatch
):
    assert plainly_needs_split(*found(seen, searched, DRAG))
    monkeypatch.setattr(
        adaptive_split, "novel_on_held_out", lambda *_, **how: (0.0, Finding(UNSEEN, "", 0.0))
    )
    assert plainly_needs_split(*found(seen, searched, DRAG))
    assert not plainly_needs_split(*found(seen, searched, DRAG, structured=False))
    assert not plainly_needs_split(*found(seen, searched))
    assert not plainly_needs_split(*found(seen, searched, DRAG, vigour=UP_AND_DOWN))


def test_a_swing_that_may_be_lost_is_not_plain(seen, searched):
    model, unseen = found(seen, searched, DRAG)
    swings = Term(SuspendedPayload(0.1, 1.0))
    hung = dc.replace(model, best=dc.replace(model.best, terms=(*model.best.terms, swings)))
    assert not plainly_needs_split(hung, unseen)


def test_a_force_that_unseen_flights_alone_show_is_plain_however_small_it_is(seen, searched, monkeypatch):
    model, unseen = found(seen, searched)
    asked = []
    monkeypatch.setattr(
        adaptive_split,
        "novel_on_held_out",
        lambda *_, gusty: asked.append(gusty) or (0.9, Finding(UNSEEN, "", 0.9)),
    )
    for slowly in (0.1, 0.9):
        monkeypatch.setattr(adaptive_split, "gust_probability", lambda *_, slowly=slowly: slowly)
        assert plainly_needs_split(model, unseen)
    assert asked == [False, True]


def test_where_no_flight_is_long_enough_for_two_halves_there_is_one_look(seen, searched, monkeypatch):
    model, unseen = found(seen, searched, DRAG, seconds=2 * REAL.thresholds.split_half - 0.5)
    assert plainly_needs_split(model, unseen)
    sought = []
    monkeypatch.setattr(adaptive_split, "find_map_model", lambda *of, **how: sought.append(of) or model)
    first, joined = infer_adaptively(model.problem.flights, unseen, None, lambda share, text: None)
    assert joined == []
    assert len(sought) == 1
    assert [e.name for e in first.flights] == ["a", "b"]


def test_what_is_no_more_than_noise_asks_for_no_second_look(diagnosed):
    dut = diagnosed()
    assert dut.joined == ()
    assert dut.verdict == ()


def test_a_half_is_the_flight_up_to_its_middle_and_its_rows_do_not_count(seen):
    flight = seen(name="c", seconds=10.0)
    (half,), (judge,) = split_flights([flight], least=REAL.thresholds.split_half)
    assert half.name == "first half of c"
    assert (half.goes_on, judge.goes_on, flight.goes_on) == (True, False, False)
    assert half.log.t[-1] < 5.0 <= half.log.t[-1] + 2 * flight.log.step
    assert half.grid.step == pytest.approx(flight.grid.step)
    np.testing.assert_array_equal(scored_rows([], judge), judge.t > 5.0)
    np.testing.assert_array_equal(judge.y, flight.y)


def test_a_flight_too_short_for_two_halves_judges_whole(seen):
    flight = seen(name="c", seconds=2 * REAL.thresholds.split_half - 0.5)
    halves, (judge,) = split_flights([flight], least=REAL.thresholds.split_half)
    assert halves == []
    assert scored_rows([], judge).all()
