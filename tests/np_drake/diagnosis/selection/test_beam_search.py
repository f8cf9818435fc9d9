import dataclasses as dc
import math

import numpy as np
import pytest

from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import Candidate, RegressionProblem, library_candidates, prior_of
from np_drake.diagnosis.selection.map_model import search
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.weak_rotor import WeakRotor

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)

SEEDS = (1, 2)


def problem_of(seen, noise, *effects, nuisance=(), seconds=8.0) -> RegressionProblem:
    flights = [seen(*effects, name=str(i), seed=i, noise=1.0, seconds=seconds) for i in SEEDS]
    return RegressionProblem(
        flights, noise, list(nuisance), library_candidates(flights), temperature=1.0, options=REAL
    )


def names(problem: RegressionProblem, members) -> list[str]:
    return sorted(name for i in members for name in problem.candidates[i].identifiers)


PLANTED = [
    (),
    (MassError(0.2),),
    (LinearDrag(),),
    (WeakRotor(3, 0.9),),
    (MassError(0.2), LinearDrag()),
    (MassError(-0.2), LinearDrag(), WeakRotor(3, 0.95)),
]


def test_whitened_columns_are_kept_until_another_noise_asks(seen, noise):
    dut = problem_of(seen, noise)
    flight, other = dut.flights
    first, second = dut.candidates[:2]
    kept = dut.white(noise, flight, first)
    np.testing.assert_array_equal(kept, flight.white(noise, first.columns[flight.name]))
    assert dut.white(noise, flight, first) is kept
    assert dut.white(noise, other, first) is not kept
    assert dut.white(noise, flight, second) is not kept
    louder = dc.replace(noise, mixing=0.5 * noise.mixing)
    np.testing.assert_allclose(dut.white(louder, flight, first), 0.5 * kept, rtol=1e-12)
    assert dut.white(noise, flight, first) is not kept


@pytest.mark.parametrize(
    "effects", PLANTED, ids=lambda e: "+".join(i.identifier for i in e) or "nothing"
)
def test_planted_sets_are_found(seen, noise, effects):
    dut = problem_of(seen, noise, *effects)
    best = search(dut)[0]
    assert names(dut, best.members) == sorted(e.identifier for e in effects)
    for i in best.members:  # the weak rotor is the third
        if dut.candidates[i].identifiers == ("weak_rotor",):
            assert dut.candidates[i].variant == "rotor=3"


@pytest.fixture(scope="module")
def searched(seen, noise):
    dut = problem_of(seen, noise, MassError(0.2), LinearDrag(), CommandDelay(0.03))
    return dut, search(dut)


def test_no_model_names_an_effect_twice(searched):
    problem, models = searched
    assert len(models) > 100
    for model in models:
        named = names(problem, model.members)
        assert len(named) == len(set(named))


def test_a_delay_and_a_clock_of_the_other_sign_never_come_together(searched):
    problem, models = searched
    sets = [set(names(problem, m.members)) for m in models]
    assert any("command_delay" in s for s in sets)
    assert not any("clock_offset" in s for s in sets)  # commands that come late are not early
    one = {c.identifiers[0]: i for i, c in enumerate(problem.candidates)}
    assert not problem.fits_together((one["command_delay"], one["clock_offset"]))
    assert problem.score((one["clock_offset"],)) == -math.inf


def test_commands_that_act_before_their_row_are_those_of_a_clock(seen, noise):
    problem = problem_of(seen, noise, ClockOffset(0.03))
    assert names(problem, search(problem)[0].members) == ["clock_offset"]


def test_models_come_best_first_and_none_is_next_to_a_better_one(searched):
    problem, models = searched
    scores = [m.score for m in models]
    assert scores == sorted(scores, reverse=True)
    assert np.isfinite(scores).all()
    best = models[0].members
    for i in best:
        fewer = tuple(j for j in best if j != i)
        assert problem.score(fewer) < models[0].score
    for i in range(len(problem.candidates)):
        if problem.fits_together((*best, i)):
            assert problem.score((*best, i)) < models[0].score


def test_the_empty_model_scores_nothing(searched):
    problem, models = searched
    assert problem.score(()) == 0.0
    assert any(m.members == () for m in models)


def test_the_score_is_evidence_and_prior(searched):
    problem, _ = searched
    i = next(k for k, c in enumerate(problem.candidates) if c.identifiers == ("weak_rotor",))
    evidence = problem.total.log_evidence(problem.columns((i,)))
    assert problem.score((i,)) == pytest.approx(
        evidence + REAL.priors.of_effect("weak_rotor") - math.log(4)
    )


def test_an_impossible_set_is_never_a_model(seen, noise):
    flights = [seen(MassError(0.2), name="1", seed=1, noise=1.0, seconds=6.0)]
    candidates = library_candidates(flights)
    mass = next(c for c in candidates if c.identifiers == ("mass_error",))
    heavy = Candidate(("heavy",), "", mass.columns, mass.terms, possible=lambda c: bool(c[0] < 0))
    light = Candidate(("light",), "", mass.columns, mass.terms, possible=lambda c: bool(c[0] > 0))
    problem = RegressionProblem(flights, noise, [], [heavy, light], temperature=1.0, options=REAL)
    models = search(problem)
    assert [names(problem, m.members) for m in models if 0 in m.members] == []
    assert names(problem, models[0].members) == ["light"]


def test_a_set_that_may_be_impossible_is_less_likely_by_as_much(seen, noise):
    flights = [seen(MassError(0.2), name="1", seed=1, noise=1.0, seconds=6.0)]
    mass = next(c for c in library_candidates(flights) if c.identifiers == ("mass_error",))
    sure = Candidate(("mass_error",), "", mass.columns, mass.terms, possible=lambda c: True)
    unsure = dc.replace(sure, mended=lambda mean, covariance: (mean, -3.0))
    problem = RegressionProblem(flights, noise, [], [sure, unsure], temperature=1.0, options=REAL)
    assert problem.score((1,)) == pytest.approx(problem.score((0,)) - 3.0)


def test_nuisance_that_explains_an_effect_leaves_nothing_to_name(seen, noise):
    flights = [seen(RotorGyroscopic(), name=str(i), seed=i, noise=1.0, seconds=8.0) for i in SEEDS]
    candidates = library_candidates(flights)
    own = next(c for c in candidates if c.identifiers == ("rotor_gyroscopic",))
    without = search(
        RegressionProblem(flights, noise, [], candidates, temperature=1.0, options=REAL)
    )[0]
    assert candidates.index(own) in without.members
    nuisance = Candidate((), "nuisance", own.columns, own.terms)
    problem = RegressionProblem(
        flights, noise, [nuisance], candidates, temperature=1.0, options=REAL
    )
    assert search(problem)[0].members == ()


def test_candidates_put_beside_others_are_judged_as_if_they_had_been_there(seen, noise):
    flights = [seen(MassError(0.2), name="1", seed=1, noise=1.0, seconds=6.0)]
    first, *more = library_candidates(flights)[:4]
    whole = RegressionProblem(flights, noise, [], [first, *more], temperature=2.0, options=REAL)
    dut = RegressionProblem(flights, noise, [], [first], temperature=2.0, options=REAL).extended(
        more
    )
    for members in ((0,), (1, 2), (0, 3)):
        assert dut.score(members) == pytest.approx(whole.score(members))


@pytest.mark.parametrize(
    "effects, costs",
    [
        (["constant_wind", "linear_drag"], ["constant_wind"]),
        (["constant_wind", "linear_drag", "quadratic_drag"], ["constant_wind", "quadratic_drag"]),
        (["constant_wind"], ["constant_wind"]),
        (["linear_drag", "mass_error"], ["linear_drag", "mass_error"]),
        (["unknown:rates", "clock_offset"], ["unknown:rates", "clock_offset"]),
        ([], []),
    ],
    ids=str,
)
def test_a_wind_brings_the_drag_through_which_it_is_felt(effects, costs):
    assert prior_of(effects, priors=REAL.priors) == pytest.approx(
        sum(map(REAL.priors.of_effect, costs))
    )
