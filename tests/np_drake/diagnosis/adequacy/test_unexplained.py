"""Laws of what the causes leave: noise, or something the library does not have."""

import copy
import dataclasses as dc

import pytest

from np_drake.diagnosis.decision.unexplained import LinearModel, find_unexplained
from np_drake.diagnosis.held_out import on_held_out
from np_drake.diagnosis.options import Options

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)


@pytest.fixture(scope="module")
def linear():
    """Return the linear model of a case with the structure beside it; each is made once."""
    known: dict[int, tuple[LinearModel, tuple[int, ...]]] = {}

    def made(case):
        if id(case) not in known:
            model = LinearModel(case.ranking)
            known[id(case)] = model, model.select_structure()[1]
        return known[id(case)]

    return made


@pytest.fixture(scope="module")
def left(linear):
    """Return what a case leaves, with other flights or options in the place of its own."""

    def answer(case, flights=None, held_out=None, options=None):
        problem = copy.copy(case.ranking.problem)
        problem.flights = list(flights or case.flights)
        ranking = dc.replace(case.ranking, problem=problem, options=options or case.ranking.options)
        held_out = held_out or case.held_out
        held = on_held_out(ranking.best, held_out, ranking.noise, ranking.options.priors)
        return find_unexplained(ranking, *linear(case), held)

    return answer


def most(found) -> float:
    """Return the probability of the most probable structure, a slow level force apart."""
    return max(s.probability for s in found[0])


def found(dut):
    return tuple(s.finding for s in dut[0] if s.probability > 0.5)


def test_of_a_nominal_flight_nothing_remains(ranked, left):
    dut = left(ranked())
    assert most(dut) < 0.2
    assert dut[1].probability < 0.2
    assert found(dut) == ()


def test_a_torque_that_no_effect_explains_remains_and_says_where_it_lives(ranked, left, damper):
    dut = left(ranked(damper))
    assert most(dut) > 0.9
    assert found(dut)[0].name == "rates"
    # times the rates' RMS [N·m]
    assert found(dut)[0].figures["torque"] == pytest.approx(0.02 * 0.9, rel=0.4)
