import dataclasses as dc
import math

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import Model, RegressionProblem, library_candidates
from np_drake.diagnosis.selection.map_model import drop_negligible, noise_of, search
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.thrust_scale import ThrustScale

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


BOTH = (MassError(0.2), LinearDrag(0.6, 0.6, 0.6))


@pytest.fixture(scope="module")
def dut(ranked):
    return ranked(*BOTH)


def test_the_model_is_tried_without_its_faint_effects_all_and_each(dut):
    names = ["mass_error", "linear_drag", "thrust_scale"]
    problem = dut.ranking.problem
    at = {c.identifiers[0]: i for i, c in enumerate(problem.candidates) if len(c.identifiers) == 1}
    members = tuple(at[name] for name in names)
    faint = dc.replace(dut.fit, terms=(*dut.fit.terms, Term(ThrustScale(0.9999))))
    tried = drop_negligible(problem, Model(members, 0.0), faint)
    assert [m.members for m in tried] == [members[:2]]
    for scale, tried_without in ((0.995, True), (0.99, False)):
        strong = dc.replace(dut.fit, terms=(*dut.fit.terms, Term(ThrustScale(scale))))
        assert bool(drop_negligible(problem, Model(members, 0.0), strong)) is tried_without


IDEAL = Options.for_sensors(False)


def _slow_power(noise, channel: int) -> float:
    """One-sided spectral density at 0.1 Hz."""
    return float(noise.spectrum(np.array([0.1]))[channel, 0])


@pytest.fixture
def residual() -> list[np.ndarray]:
    return [np.random.default_rng(1).normal(size=(1000, 15))]


def test_a_force_that_is_explained_is_known_no_better_than_the_attitude(seen, residual):
    force = np.zeros((1000, 15))
    force[:, 0] = 1000.0  # [N]
    rig = Options.for_sensors(True)
    flights = [seen(seconds=4.0)]
    calm = noise_of(flights, residual, residual, rig)
    pulled = noise_of(flights, residual, [residual[0] + force], rig)
    for channel in range(3):
        assert _slow_power(pulled, channel) > 2.0 * _slow_power(calm, channel)
    for channel in range(3, 15):  # a pull says nothing of torque and sensors
        assert _slow_power(pulled, channel) == pytest.approx(_slow_power(calm, channel))
    laboratory = noise_of(flights, residual, [residual[0] + force], IDEAL)
    assert _slow_power(laboratory, 0) < _slow_power(pulled, 0)


def test_the_power_of_errors_of_measured_rotor_speed_is_added(seen, residual):
    flights = [seen(name=str(i), seed=i, seconds=4.0) for i in (1, 2)]
    quiet = noise_of(flights, 2 * residual, 2 * residual, IDEAL)
    for flight, size in zip(flights, (3.0, 4.0), strict=True):
        vars(flight)["rotor_noise"] = np.where(np.arange(15) == 2, size, 0.0)  # of the lift
    loud = noise_of(flights, 2 * residual, 2 * residual, IDEAL)
    added = loud.innovation - quiet.innovation
    assert added[2] == pytest.approx((9.0 + 16.0) / 2, rel=0.05)
    np.testing.assert_allclose(np.delete(added, 2), 0.0, atol=1e-9)
