"""Laws of the linear model about the best fit, with generic structure beside it."""

import numpy as np
import pytest

from np_drake.diagnosis.calibration import flight_errors
from np_drake.diagnosis.decision.unexplained import LinearModel
from np_drake.diagnosis.fitting import prior_whitening, refine, scaled_jacobian
from np_drake.diagnosis.forward_model import NEVER, Term, predicted_residual
from np_drake.diagnosis.options import Options, Tolerance
from np_drake.diagnosis.regressors import RegressionProblem
from np_drake.diagnosis.selection import Ranking
from np_drake.effects.base import Effect
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic

REAL = Options.for_sensors(True)
PRIOR = REAL.priors.effect
DRAG = LinearDrag(0.3, 0.3, 0.3)


@pytest.fixture(scope="module")
def model(seen, noise):
    """Return a function that makes the linear model of a fit of `terms` to two flights under
    `acting`.
    """

    def made(acting: tuple[Effect, ...], terms: list[Term], *, drifts: bool = False):
        how = {"noise": 1.0, "seconds": 6.0}
        flights = [seen(*acting, name=n, seed=i, **how) for i, n in enumerate("ab", start=1)]
        nuisance = flight_errors(flights, Tolerance()) if drifts else []
        warm = {"temperature": REAL.priors.temperature}
        problem = RegressionProblem(flights, noise, nuisance, [], options=REAL, **warm)
        fit = refine(problem, terms, [], noise)
        ranking = Ranking((fit,), noise, problem, (), REAL)
        return LinearModel(ranking), ranking

    return made


@pytest.fixture(scope="module")
def absent(model):
    """Drag, and two effects that are not there: one leaves no trace at all."""
    terms = [Term(DRAG), Term(RotorGyroscopic()), Term(MassError(0.1), {"a": NEVER, "b": NEVER})]
    return model((DRAG,), terms)


def dense_evidence(ranking: Ranking, structure) -> float:
    """Return the log evidence of the fit's parameters, sensor errors and structure by a dense least
    squares.
    """
    fit, noise, root = ranking.best, ranking.noise, ranking.problem.temperature**-0.5
    W = np.linalg.inv(prior_whitening(fit.everything, fit.free))
    away = (fit.values - [f.neutral for f in fit.free]) / [f.scale for f in fit.free]
    rows, target = [], []
    for e in ranking.problem.flights:
        J = scaled_jacobian(fit.everything, fit.free, e)
        columns = [J @ W, *(c.columns[e.name] for c in (*ranking.problem.nuisance, *structure))]
        white = e.white(noise, np.concatenate(columns, axis=-1))
        rows.append(root * white.reshape(-1, white.shape[-1]))
        y = e.y - predicted_residual(e, fit.everything) + J @ away
        target.append(root * e.white(noise, y).ravel())
    X, y = np.concatenate(rows), np.concatenate(target)
    k = X.shape[1]
    A, b = np.vstack([X, np.eye(k)]), np.concatenate([y, np.zeros(k)])
    c = np.linalg.lstsq(A, b, rcond=None)[0]
    logdet = 2 * np.sum(np.log(np.abs(np.diag(np.linalg.qr(A, mode="r")))))
    return float(0.5 * (y @ y - np.sum((b - A @ c) ** 2)) - 0.5 * logdet)


@pytest.mark.parametrize("drifts", [False, True], ids=["ideal", "with sensor errors"])
def test_the_evidence_of_a_structure_is_that_of_a_direct_linear_regression(model, drifts):
    dut, ranking = model((DRAG,), [Term(DRAG)], drifts=drifts)
    for chosen in ((), (0,), (3, 7)):
        some = [dut.structure[g] for g in chosen]
        priors = sum(REAL.priors.of_effect(c.identifiers[0]) + c.log_prior for c in some)
        assert dut.evidence((), chosen) - priors == pytest.approx(
            dense_evidence(ranking, some), rel=1e-6
        )


def test_the_margin_of_a_planted_effect_is_large_of_an_absent_negative(absent):
    dut, _ = absent
    drag, other, *_ = dut.log_odds(())
    assert drag > 100.0
    assert other < PRIOR + 2.0  # what noise may bring
