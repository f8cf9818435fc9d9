"""Laws of the correlated prior of drag coefficients."""

import numpy as np
import pytest

from np_drake.diagnosis.fitting import free_parameters, prior_whitening, refine
from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import library_candidates
from np_drake.effects.base import prior_root
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.quadratic_drag import QuadraticDrag

OPTIONS = Options.for_sensors(True)
PRIORS = OPTIONS.priors
DRAG = LinearDrag(0.4, 0.4, 0.2)
ALONG_X = (1.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module", autouse=True)
def fixed_widths():
    """Keep priors as wide as they are typical."""
    with pytest.MonkeyPatch.context() as patch:
        for effect in (LinearDrag, QuadraticDrag):
            patch.setattr(effect, "widens", False)
        yield


@pytest.fixture(scope="module")
def flight(seen):
    return seen(DRAG, name="a", seed=1, noise=1.0, seconds=8.0, vigour=ALONG_X)


@pytest.fixture(scope="module")
def fit(flight, noise):
    return refine([Term(DRAG)], [], [flight], noise, temperature=1.0, priors=PRIORS)


@pytest.mark.parametrize("effect", [LinearDrag, QuadraticDrag, GyroBias])
def test_whitened_deviations_of_the_prior_are_independent(flight, effect):
    terms = [Term(GyroBias()), Term(effect())]
    free = free_parameters(terms, [flight], {}, PRIORS)
    W, root = prior_whitening(terms, free), prior_root(effect, flight.vehicle)
    scaled = root / np.array([f.scale for f in free if f.term == 1])[:, None]
    np.testing.assert_allclose(W[3:, 3:] @ scaled, np.eye(3), atol=1e-12)
    np.testing.assert_array_equal(W[:3], np.eye(6)[:3])


def marginal(flight, noise, X: np.ndarray, prior: np.ndarray) -> float:
    """Return log N(y; 0, 1 + X S X') of the whitened flight, less its constant, for a prior
    covariance S.
    """
    y = flight.white(noise, flight.y).ravel()
    X = X.reshape(len(y), -1)
    b, A = X.T @ y, X.T @ X
    explained = b @ np.linalg.solve(np.linalg.inv(prior) + A, b)
    return float(
        -0.5 * (y @ y - explained) - 0.5 * np.linalg.slogdet(np.eye(len(A)) + prior @ A)[1]
    )


def test_a_fit_has_the_evidence_of_the_linear_problem_with_its_prior(flight, noise, fit):
    (drag,) = (c for c in library_candidates([flight]) if c.identifiers == ("linear_drag",))
    root = prior_root(LinearDrag, flight.vehicle)
    columns = drag.columns["a"] @ np.linalg.inv(root)  # by physical coefficients
    X, prior = flight.white(noise, columns), root @ root.T
    expected = marginal(flight, noise, X, prior)
    assert fit.log_evidence == pytest.approx(expected, abs=1e-3)
    independent = marginal(flight, noise, X, np.diag(np.diag(prior)))
    assert abs(expected - independent) > 0.3  # the correlation matters here
