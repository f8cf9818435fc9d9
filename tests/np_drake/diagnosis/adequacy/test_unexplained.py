"""Laws of what the causes leave: noise, or something the library does not have."""

import copy
import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.decision import unexplained as module
from np_drake.diagnosis.decision.unexplained import (
    LinearModel,
    Unexplained,
    _indication,
    find_unexplained,
    strongest_line,
)
from np_drake.diagnosis.held_out import on_held_out
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.result import CHANNELS
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.motor_lag import MotorLag

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)

CLEAR = 10.0  # prominence of a line in these short flights that noise does not have [1]
SENSITIVE = dc.replace(REAL, thresholds=dc.replace(REAL.thresholds, line_ratio=CLEAR))
SURE = 0.5  # least probability of what is unknown


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

    def answer(case, flights=None, held_out=None, options=None) -> Unexplained:
        problem = copy.copy(case.ranking.problem)
        problem.flights = list(flights or case.flights)
        ranking = dc.replace(case.ranking, problem=problem, options=options or case.ranking.options)
        held_out = held_out or case.held_out
        held = on_held_out(ranking.best, held_out, ranking.noise, ranking.options.priors)
        return find_unexplained(ranking, *linear(case), held)

    return answer


def most(found: Unexplained) -> float:
    """Return the probability of the most probable structure, a slow level force apart."""
    return max(s.probability for s in found.structures)


def test_of_a_nominal_flight_nothing_remains(ranked, left):
    dut = left(ranked())
    assert most(dut) < 0.2
    assert dut.slow.probability < 0.2
    assert dut.findings == ()


def test_a_torque_that_no_effect_explains_remains_and_says_where_it_lives(ranked, left, damper):
    dut = left(ranked(damper))
    assert most(dut) > 0.9
    assert dut.findings[0].name == "rates"
    # times the rates' RMS [N·m]
    assert dut.findings[0].figures["torque"] == pytest.approx(0.02 * 0.9, rel=0.4)


def test_structure_is_there_by_evidence_and_counts_where_material(ranked, linear, damper):
    case = ranked(damper)
    model, structure = linear(case)
    probability, finding, power, position = _indication(model, structure, structure[0], REAL)
    assert probability > 0.99
    assert finding.name == "rates"
    assert np.sqrt(power[3:].sum()) == pytest.approx(finding.figures["torque"])
    assert position > 0
    blunt = dc.replace(REAL.materiality, torque=100.0, force=100.0)
    assert _indication(model, structure, structure[0], dc.replace(REAL, materiality=blunt))[:2] == (
        0.0,
        finding,
    )


@pytest.mark.parametrize(
    "effect",
    [InertiaError(1.3, 0.8, 1.2), MotorLag(0.04), CommandDelay(0.02)],
    ids=lambda e: e.identifier,
)
def test_no_generic_torque_is_unknown_beside_an_effect_that_explains_it(ranked, left, effect):
    case = ranked(effect)
    assert effect.identifier in [t.effect.identifier for t in case.fit.terms]
    assert most(left(case)) < SURE


@pytest.mark.parametrize("channel, size", [(0, 2.0), (4, 0.1)], ids=["force [N]", "torque [N·m]"])
def test_what_held_out_flights_alone_show_is_not_what_training_leaves(ranked, left, channel, size):
    case = ranked()
    held_out = [dc.replace(e, y=e.y.copy()) for e in case.held_out]
    for e in held_out:
        e.y[:, channel] += size * np.sin(2 * np.pi * 0.5 * e.t) * np.sin(2 * np.pi * 0.13 * e.t)
    assert {f.name for f in left(case, held_out=held_out).findings} <= {"burst"}


@pytest.mark.parametrize("where", ["a flight of the fit", "the held-out one"])
@pytest.mark.parametrize("size, unknown", [(0.03, False), (2.0, True)], ids=["as noise", "large"])
def test_a_force_now_and_then_is_unknown_wherever_it_is(ranked, left, where, size, unknown):
    case = ranked()
    flights, held_out = list(case.flights), list(case.held_out)
    struck = flights if where == "a flight of the fit" else held_out
    struck[0] = dc.replace(struck[0], y=struck[0].y.copy())
    struck[0].y[:, 2] -= size * np.exp(-(((struck[0].t - 3.0) / 0.3) ** 2))
    dut = left(case, flights, held_out)
    assert (most(dut) > SURE) is unknown
    bursts = [f for f in dut.findings if f.name == "burst"]
    assert len(bursts) == unknown
    for found in bursts:
        assert struck[0].name in found.text
        assert found.figures["time"] == pytest.approx(3.0, abs=0.1)


@pytest.mark.parametrize("channel", [0, 4], ids=["force", "torque"])
@pytest.mark.parametrize("times", [0.7, 2.0], ids=["too small to matter", "large"])
def test_a_line_is_unknown_only_where_it_is_large_enough_to_matter(ranked, left, channel, times):
    case = ranked()
    least = module._least_lines(case.flights, SENSITIVE.materiality)[channel]
    wave = [dc.replace(e, y=e.y.copy()) for e in (*case.flights, *case.held_out)]
    for e in wave:
        e.y[:, channel] += times * least * np.sqrt(2) * np.sin(2 * np.pi * 2.3 * e.t)
    *flights, held_out = wave
    line = strongest_line(flights, {e.name: case.fit.residual(e) for e in flights})
    assert line.prominence > CLEAR
    assert line.channel == channel
    assert line.rms == pytest.approx(times * least, rel=0.1)
    dut = left(case, flights, [held_out], SENSITIVE)
    assert (most(dut) > SURE) is (times > 1)
    assert ("line" in {f.name for f in dut.findings}) is (times > 1)


def test_a_line_that_does_not_matter_hides_none_that_does(ranked, left):
    case = ranked()
    least = module._least_lines(case.flights, SENSITIVE.materiality)
    both = [dc.replace(e, y=e.y.copy()) for e in (*case.flights, *case.held_out)]
    for e in both:
        for channel, times, f in ((0, 0.8, 2.3), (4, 1.3, 5.3)):
            e.y[:, channel] += times * least[channel] * np.sqrt(2) * np.sin(2 * np.pi * f * e.t)
    *flights, held_out = both
    dut = left(case, flights, [held_out], SENSITIVE)
    (line,) = (f for f in dut.findings if f.name == "line")
    assert f"a line in {CHANNELS[4]} " in line.text
    assert most(dut) > SURE


def test_in_gusts_which_come_and_go_no_burst_is_asked_for(ranked, left, monkeypatch):
    case = ranked()
    (held_out,) = case.held_out
    held_out = dc.replace(held_out, y=held_out.y.copy())
    held_out.y[:, 2] -= 2.0 * np.exp(-(((held_out.t - 3.0) / 0.3) ** 2))
    for slowly, found in ((0.0, True), (1.0, False)):
        monkeypatch.setattr(module, "gust_probability", lambda *_, slowly=slowly, **__: slowly)
        dut = left(case, held_out=[held_out])
        assert ("burst" in {f.name for f in dut.findings}) is found
