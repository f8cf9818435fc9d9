import numpy as np
import pytest

from np_drake.diagnosis.candidates import effect_candidates, library_candidates
from np_drake.diagnosis.onset import ONSET_PRIOR, best_onsets, gated_candidates, late_payloads, onset_profile
from np_drake.diagnosis.search import Problem
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.weak_rotor import WeakRotor


def problem_of(flights, noise, effects) -> Problem:
    candidates = [c for e in effects for c in effect_candidates(type(e), flights, {})]
    return Problem(flights, noise, [], candidates, temperature=1.0)


@pytest.mark.parametrize("when", [2.0, 5.3, 9.0])
@pytest.mark.parametrize(
    "effect", [MassError(0.2), WeakRotor(2, 0.9), LinearDrag(0.6, 0.6, 0.6)], ids=lambda e: e.identifier
)
def test_the_instant_is_found(seen, noise, effect, when):
    flights = [seen(effect, name="late", seed=1, noise=1.0, onset={effect.identifier: when})]
    problem = problem_of(flights, noise, [effect])
    right = [c for c in problem.candidates if c.variant in ("", "rotor=2")]
    onset, gain = best_onsets(problem, right[0])
    slack = 0.6 if isinstance(effect, LinearDrag) else 0.2  # a drag shows once there is speed [s]
    assert onset["late"] == pytest.approx(when, abs=slack)
    assert gain > 10.0


def test_what_acts_from_the_start_has_no_onset(seen, noise):
    effect = MassError(0.2)
    flights = [seen(effect, name=str(i), seed=i, noise=1.0) for i in (1, 2)]
    problem = problem_of(flights, noise, [effect])
    assert best_onsets(problem, problem.candidates[0]) == ({}, 0)
    assert gated_candidates(problem) == []


def test_each_flight_has_its_own_onset(seen, noise):
    effect = MassError(0.2)
    early = seen(effect, name="early", seed=1, noise=1.0, onset={"mass_error": 3.0})
    late = seen(effect, name="late", seed=2, noise=1.0, onset={"mass_error": 8.0})
    always = seen(effect, name="always", seed=3, noise=1.0)
    problem = problem_of([early, late, always], noise, [effect])
    onset, _ = best_onsets(problem, problem.candidates[0])
    assert onset.keys() == {"early", "late"}
    assert onset["early"] == pytest.approx(3.0, abs=0.2)
    assert onset["late"] == pytest.approx(8.0, abs=0.2)
    late = next(c for c in gated_candidates(problem) if c.identifiers == ("mass_error",))
    assert late.onset == onset
    assert late.log_prior == problem.candidates[0].log_prior + 2 * ONSET_PRIOR  # each instant is a choice


def test_noise_alone_begins_nowhere(seen, noise):
    flights = [seen(name=str(i), seed=i, noise=1.0, seconds=8.0) for i in (1, 2)]
    problem = Problem(flights, noise, [], library_candidates(flights), temperature=2.0)
    assert gated_candidates(problem) == []


def test_the_profile_at_the_start_is_the_evidence_of_the_whole_flight(seen, noise):
    flights = [seen(MassError(0.1), name="1", seed=1, noise=1.0, seconds=8.0)]
    problem = problem_of(flights, noise, [MassError()])
    _, profile = onset_profile(problem, problem.candidates[0], flights[0])
    expected = problem.total.log_evidence(np.array([0]))
    assert profile[0] == pytest.approx(expected, rel=1e-6)


def test_a_payload_that_is_hung_on_in_flight_is_found_to_the_row(seen, noise):
    payload = SuspendedPayload(0.2, 0.5)
    onset = {"suspended_payload": 4.0}
    flights = [seen(payload, name="1", seed=1, noise=1.0, seconds=10.0, onset=onset)]
    problem = problem_of(flights, noise, [MassError(0.2)])
    found = late_payloads(problem, gated_candidates(problem))
    assert {c.identifiers for c in found} == {("suspended_payload",)}
    assert found[0].onset["1"] == pytest.approx(4.0, abs=0.03)
    assert float(found[0].variant.removeprefix("length=")) == pytest.approx(0.5, rel=0.05)
