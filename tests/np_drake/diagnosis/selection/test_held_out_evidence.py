import copy
import dataclasses as dc
import math

import pytest

from np_drake.diagnosis.forward_model.term import NEVER, Term
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.selection import held_out_evidence
from np_drake.diagnosis.selection.held_out_evidence import _onset_prior, rerank_by_held_out_evidence
from np_drake.diagnosis.selection.ranking import names_of_fit, ranked, score_of
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.quadratic_drag import QuadraticDrag
from np_drake.effects.suspended_payload import SuspendedPayload

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)
PRIORS = REAL.priors
SEARCH = REAL.search

FAINT = LinearDrag(0.05, 0.05, 0.05)
SLOW, FAST = 0.5, 1.5  # vigour


@pytest.fixture(scope="module")
def flight(seen):
    def infer(name: str, seed: int, vigour: float, effect: LinearDrag = FAINT):
        return seen(effect, name=name, seed=seed, noise=1.0, seconds=10.0, vigour=vigour)

    return infer


@pytest.fixture(scope="module")
def slow(flight, searched):
    """What slow flights say: a drag, and hardly which."""
    return ranked(searched([flight("a", 1, SLOW), flight("b", 2, SLOW)]))


def test_unseen_flights_decide_between_names_that_fitted_ones_leave_open(flight, slow):
    wrong, right = ({names_of_fit(f): f for f in slow.fits}[n,] for n in ("quadratic_drag", "linear_drag"))
    assert 0 < score_of(wrong, priors=PRIORS) - score_of(right, priors=PRIORS) < SEARCH.held_out_margin
    dut = rerank_by_held_out_evidence(slow, [flight("c", 3, FAST)])
    assert names_of_fit(dut.fits[0]) == names_of_fit(dut.named) == ("linear_drag",)
    assert dut.probability["linear_drag"] > 0.99 > 0.9 > slow.probability["linear_drag"]
    assert dut.fits[0].values == pytest.approx(right.values)  # unseen flights are not fitted to


def test_two_unseen_flights_say_what_each_says(flight, slow):
    c, d = flight("c", 3, FAST), flight("d", 4, FAST)
    brought = [
        rerank_by_held_out_evidence(slow, some).fits[0].held_out_evidence for some in ([c], [d], [c, d])
    ]
    assert brought[2] == pytest.approx(sum(brought[:2]))


def test_what_unseen_flights_say_is_tempered_as_what_fitted_ones_do(flight, slow):
    hot = dc.replace(slow, problem=copy.copy(slow.problem))
    hot.problem.temperature = 2 * slow.problem.temperature
    brought = [
        rerank_by_held_out_evidence(r, [flight("c", 3, FAST)]).fits[0].held_out_evidence for r in (slow, hot)
    ]
    assert brought[1] == pytest.approx(0.5 * brought[0])


def test_an_onset_that_is_sought_in_an_unseen_flight_costs_its_prior(seen, slow, monkeypatch):
    e = seen(FAINT, name="c", seed=3, noise=1.0, seconds=10.0, vigour=3.0, onset={"linear_drag": 6.0})
    assert (
        PRIORS.another_onset - math.log(len(e.t))
        <= _onset_prior([Term(FAINT, {"c": 6.0})], 6.0, e, slow.noise, priors=PRIORS)
        < -1.0
    )
    assert _onset_prior([], NEVER, e, slow.noise, priors=PRIORS) == PRIORS.absence
    wrong, right = (
        next(f for f in slow.fits if names_of_fit(f) == (n,)) for n in ("quadratic_drag", "linear_drag")
    )
    begun = dc.replace(right, terms=(Term(FAINT, {"a": 6.0}),))
    ranking = dc.replace(slow, fits=(dc.replace(wrong, terms=(Term(QuadraticDrag(0.0, 0.0, 0.0)),)), begun))
    brought = []
    for prior in (0.0, -7.0):
        monkeypatch.setattr(held_out_evidence, "_onset_prior", lambda *_, prior=prior: prior)
        (asked,) = (
            f for f in rerank_by_held_out_evidence(ranking, [e]).fits if names_of_fit(f) == ("linear_drag",)
        )
        brought.append(asked.held_out_evidence)
    assert brought[1] == pytest.approx(brought[0] - 7.0)


def test_an_unseen_flight_that_shows_no_more_than_the_fitted_ones_decides_nothing(flight, slow):
    dut = rerank_by_held_out_evidence(slow, [flight("c", 3, SLOW)])
    assert all(abs(f.held_out_evidence) < SEARCH.held_out_margin for f in dut.fits if f.terms)


def test_names_that_are_more_or_less_are_not_asked_for_what_training_does_not_show(flight, searched):
    hidden = LinearDrag(0.03, 0.03, 0.03)
    ranking = ranked(searched([flight("a", 1, 0.3, hidden), flight("b", 2, 0.3, hidden)]))
    assert names_of_fit(ranking.fits[0]) == ()
    assert rerank_by_held_out_evidence(ranking, [flight("c", 3, 2.0, hidden)]) is ranking


def test_none_is_asked_beside_two_names_of_which_neither_is_right(flight, slow):
    """What is best by chance must not make way for the next best, which unseen flights do not contradict."""
    drags, none = [f for f in slow.fits if f.terms], next(f for f in slow.fits if not f.terms)
    wild, idle = (
        dc.replace(f, terms=(Term(effect),))
        for f, effect in zip(
            drags[:2], (QuadraticDrag(0.5, 0.5, 0.5), LinearDrag(0.0, 0.0, 0.0)), strict=True
        )
    )
    nothing = [flight("c", 3, FAST, LinearDrag(0.0, 0.0, 0.0))]
    dut = rerank_by_held_out_evidence(dc.replace(slow, fits=(wild, idle, none)), nothing)
    assert min(f.held_out_evidence for f in dut.fits[:2]) > 100
    assert {names_of_fit(f) for f in dut.fits[:2]} == {(), ("linear_drag",)}


def test_a_swing_that_unseen_flights_would_be_fitted_to_is_not_asked(flight, slow):
    swings = (dc.replace(slow.fits[0], terms=(Term(SuspendedPayload()),)), *slow.fits[1:])
    ranking = dc.replace(slow, fits=swings)
    assert rerank_by_held_out_evidence(ranking, [flight("c", 3, FAST)]) is ranking
