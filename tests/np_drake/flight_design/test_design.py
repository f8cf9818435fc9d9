"""Laws of a design: never worse than the best naive manoeuvre, seeded, and quick."""

import dataclasses as dc
import time

import numpy as np
import pytest

from np_drake.effects.explanation import Explanation
from np_drake.effects.linear_drag import LinearDrag
from np_drake.flight_design.design import DESIGNED, FlightDesigner
from np_drake.flight_design.information import SURE
from np_drake.flight_design.naive import NAIVE


@pytest.fixture(scope="module")
def designer(heavy, readings, limits):
    return FlightDesigner(heavy, readings, limits, 8.0)


@pytest.fixture(scope="module")
def candidates(designer):
    return designer.candidates(evaluations=30, seed=1)


def test_the_design_is_never_worse_than_a_naive_manoeuvre(candidates):
    assert [c.name for c in candidates] == [DESIGNED, *NAIVE]
    assert candidates[0].information.value == max(c.information.value for c in candidates)


def test_the_design_keeps_its_limits(candidates):
    for c in candidates:
        assert max(c.usage.values()) < 0.85
        assert c.usage[c.tightest] == max(c.usage.values())


def test_the_same_seed_gives_the_same_design(designer, candidates):
    again = designer.candidates(evaluations=30, seed=1)[0]
    t = designer.basis.t
    np.testing.assert_array_equal(again.reference.sample(t), candidates[0].reference.sample(t))


def test_a_smaller_motion_tells_less_and_uses_less(designer, candidates):
    small = designer.shrunk(candidates[0], 0.3)
    assert small.information.value < candidates[0].information.value
    assert max(small.usage.values()) < max(candidates[0].usage.values())


def test_an_evaluation_takes_milliseconds(designer, candidates):
    start = time.process_time()
    designer.information(candidates[0].reference)
    assert time.process_time() - start < 0.3  # s; 300 of them within 30 s need 0.1, a loaded machine more


def test_where_all_is_sure_the_flight_is_gentle(nothing, drag, readings, limits):
    strong = Explanation(drag.named, 0.5, (LinearDrag(1.0, 1.0, 1.0),))
    designer = FlightDesigner([nothing, strong], readings, limits, 8.0)
    calls = []
    dut = designer.candidates(evaluations=30, seed=1, tell=calls.append)[0]
    assert dut.information.value == SURE
    assert len(calls) < 30
    assert calls[-1] == 1.0
    assert max(dut.usage.values()) < 0.7


def test_a_single_explanation_is_flown_for_its_parameters(drag, readings, limits):
    alone = [dc.replace(drag, probability=1.0)]
    best, *naive = FlightDesigner(alone, readings, limits, 8.0).candidates(evaluations=20, seed=1)
    assert best.information.value >= max(c.information.value for c in naive)
    assert naive[0].information.value == pytest.approx(0.0, abs=1e-6)  # hover tells no drag
