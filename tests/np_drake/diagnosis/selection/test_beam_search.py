import math

import numpy as np
import pytest

from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import RegressionProblem, library_candidates
from np_drake.diagnosis.selection.map_model import search
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError

REAL = Options.for_sensors(True)

SEEDS = (1, 2)


def problem_of(seen, noise, *effects, nuisance=(), seconds=8.0) -> RegressionProblem:
    flights = [seen(*effects, name=str(i), seed=i, noise=1.0, seconds=seconds) for i in SEEDS]
    return RegressionProblem(
        flights, noise, list(nuisance), library_candidates(flights), temperature=1.0, options=REAL
    )


@pytest.fixture(scope="module")
def searched(seen, noise):
    dut = problem_of(seen, noise, MassError(0.2), LinearDrag(), CommandDelay(0.03))
    return dut, search(dut)


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


def test_the_score_is_evidence_and_prior(searched):
    problem, _ = searched
    i = next(k for k, c in enumerate(problem.candidates) if c.identifiers == ("weak_rotor",))
    evidence = problem.total.log_evidence(problem.columns((i,)))
    assert problem.score((i,)) == pytest.approx(
        evidence + REAL.priors.of_effect("weak_rotor") - math.log(4)
    )
