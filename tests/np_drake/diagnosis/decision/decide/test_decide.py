"""Laws of causes and minor findings: which effects of the best model are which, and how
probable.
"""

import dataclasses as dc

import numpy as np
import pytest
from scipy import special

from np_drake.diagnosis.decision import decide as module
from np_drake.diagnosis.decision.decide import (
    MOST_ALTERNATIVES,
    decide_term,
    equivalents,
    without_late_onsets,
    without_missing_drag,
)
from np_drake.diagnosis.decision.predictive_evidence import PredictiveGain
from np_drake.diagnosis.decision.unexplained import LinearModel
from np_drake.diagnosis.forward_model import pendulum_error
from np_drake.diagnosis.held_out import on_held_out
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import Model
from np_drake.diagnosis.result import Cause
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.rotor_inflow import hover_induced_velocity
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle

IDEAL = Options.for_sensors(False)
DRAG = LinearDrag(0.6, 0.6, 0.6)
PAPER = Vehicle()


@pytest.fixture(scope="module")
def drag(ranked):
    return ranked(DRAG)


@pytest.fixture(scope="module")
def margins(drag):
    return LinearModel(drag.ranking).log_odds(())


@pytest.fixture(scope="module")
def judged_with(drag, margins):
    """Return the arguments of `decide_term` for the flights with drag, under another fit or
    options.
    """

    def arguments(fit=None, options=None, probability=None):
        ranking = drag.ranking
        ranking = dc.replace(
            ranking,
            fits=(fit or ranking.best,),
            options=options or ranking.options,
            probability=probability or ranking.probability,
        )
        held = on_held_out(ranking.best, drag.held_out, ranking.noise, ranking.options)
        return ranking, margins, held

    return arguments


def test_a_probability_is_that_of_the_model_its_margin_and_its_size(judged_with):
    ranking, margins, held = judged_with(probability={"linear_drag": 0.8})
    found = decide_term(ranking, margins, held, 0)
    assert found.in_model == pytest.approx(0.8 * special.expit(margins[0]))
    assert found.material == 1.0
    assert found.probability == pytest.approx(found.in_model)
    assert dc.replace(found, material=0.5).probability == pytest.approx(0.5 * found.in_model)
    assert dc.replace(found, stands_for="no drag pushes").probability == 0.0
    weak = dc.replace(found, gain=PredictiveGain(1.8, np.full(4, 0.45), tuple("aabb"), np.zeros(0)))
    assert weak.reason.startswith("it does not predict: 1.8 ")
    late = dc.replace(weak, timing=0.01)
    assert "which the logs leave open by" in late.reason
    assert module._finding(DRAG, {}, late, ()).figures["timing"] == 0.01
    worse = dc.replace(late, gain=dc.replace(weak.gain, held_out=np.full(4, -9.0)))
    assert worse.reason == "held-out flights are predicted better without it"
    assert "timing" not in module._finding(DRAG, {}, worse, ()).figures


def cause(effect) -> Cause:
    return Cause(effect.identifier, 0.9, {}, {}, effect=effect)


def test_a_wind_without_a_drag_through_which_it_is_felt_is_minor():
    wind, mass, drag = (cause(e) for e in (ConstantWind(2.0), MassError(0.2), DRAG))
    causes, minor = without_missing_drag([wind, mass], [])
    assert causes == [mass]
    assert [f.name for f in minor] == ["constant_wind"]
    assert without_missing_drag([wind, drag], []) == ([wind, drag], [])


def test_payload_parameters_are_known_no_better_than_the_pendulum_model(fit_at):
    payload = SuspendedPayload(0.2, 0.6, 0.0, 0.0, -0.05)
    exact, rough = (
        module.estimates(fit_at(payload, covariance=s), 0, PAPER, IDEAL) for s in (1e-9, 0.01)
    )
    for name, estimate in exact.items():
        half = 0.5 * np.diff(estimate.ci95)[0]
        error = 1.96 * pendulum_error(name, payload, PAPER, IDEAL.priors)[1]
        assert half == pytest.approx(error)
        assert 0.5 * np.diff(rough[name].ci95)[0] == pytest.approx(np.hypot(error, 1.96 * 0.01))


def test_downwash_makes_a_payload_heavy_and_its_tether_short(fit_at):
    payload = SuspendedPayload(0.2, 0.6, 0.0, 0.0, -0.05, damping=0.1)
    open_ = dc.replace(IDEAL, tolerance=dc.replace(IDEAL.tolerance, unmeasured=True))
    found = module.estimates(fit_at(payload, covariance=1e-9), 0, PAPER, open_)
    share = 0.1 * hover_induced_velocity(PAPER) / PAPER.gravity
    assert found["mass"].value == pytest.approx(0.2 / (1 + share))
    assert found["length"].value == pytest.approx(0.6 * (1 + share))
    assert found["length"].half > 1.96 * 0.6 * share / np.sqrt(3)


ENDS = {"a": 20.0, "b": 20.0}


def settled(**onset):
    return without_late_onsets([Cause("mass_error", 0.97, {}, onset)], ENDS)


def test_an_onset_in_the_last_second_of_a_flight_is_none():
    (cause,), late = settled(a=8.0, b=19.2)
    assert cause.onset == {"a": 8.0, "b": np.inf}
    assert late == []
    (cause,), _ = settled(a=None, b=18.9)
    assert cause.onset == {"a": None, "b": 18.9}


def test_what_begins_nowhere_else_is_no_cause():
    causes, (late,) = settled(a=19.5, b=np.inf)
    assert causes == []
    assert late.name == "mass_error"


OPTIONS = Options.for_sensors(True)
NEAR = OPTIONS.thresholds.indistinguishable_evidence


@dc.dataclass
class Candidate:
    identifiers: tuple[str, ...]
    generic: bool = False


class Problem:
    """A regression whose models have given scores; others are far worse."""

    options = OPTIONS

    def __init__(self, candidates, scores, apart=()):
        self.candidates, self._scores, self._apart = candidates, scores, set(apart)

    def score(self, members):
        return self._scores.get(tuple(sorted(members)), -1e6)

    def fits_together(self, members):
        return tuple(sorted(members)) not in self._apart


EVERY = [Candidate((name,)) for name in ("drag", "a", "b", "c", "d", "e")]


def test_alternatives_stand_best_first_within_the_threshold():
    scores = {(0,): 0.0, (1,): -0.6 * NEAR, (2,): -0.1 * NEAR, (3,): -1.01 * NEAR, (4,): 0.2 * NEAR}
    dut = equivalents(Problem(EVERY, scores), Model((0,), 0.0))
    assert list(dut) == ["drag"]
    assert dut["drag"] == ("d", "b", "a")[:MOST_ALTERNATIVES]


def test_structure_the_effect_itself_and_what_does_not_fit_are_none():
    drag, other = Candidate(("drag",)), Candidate(("b",))
    candidates = [drag, Candidate(("a",), generic=True), drag, other]
    scores = {(0,): 0.0, (1,): 0.0, (2,): 0.0, (3,): 0.0}
    assert equivalents(Problem(candidates, scores, apart=[(3,)]), Model((0,), 0.0)) == {"drag": ()}
    assert equivalents(Problem(candidates, scores), Model((1,), 0.0)) == {}
