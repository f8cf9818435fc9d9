"""Laws of isotropic priors on parameters that the flights hardly determine."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from np_drake.diagnosis.fitting.isotropic_prior import with_isotropic_prior
from np_drake.diagnosis.fitting.map_estimate import Fit
from np_drake.diagnosis.fitting.parameters import free_parameters
from np_drake.diagnosis.forward_model.term import Term
from np_drake.diagnosis.options import Options
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)


def posterior(information: np.ndarray, pull: np.ndarray, scales: np.ndarray):
    """Return mean and covariance of parameters about 0 with priors of these deviations."""
    covariance = np.linalg.inv(information + np.diag(scales**-2.0))
    return covariance @ pull, covariance


def fit_of(effect, values: np.ndarray, covariance: np.ndarray) -> Fit:
    terms, scale = (Term(effect), Term(MassError(values[-1]))), {1: 0.01}
    free = tuple(free_parameters(terms, [], scale, priors=REAL.priors))
    named = effect.of(dict(zip(effect.values, values[:3].tolist(), strict=True)))
    return Fit((Term(named),), terms[1:], free, values, covariance, 0.0, 0.0, 1)


def told(weak: float, like: np.ndarray):
    """Return information on three parameters and a mass.

    The third parameter is hardly determined, and correlates with the mass.
    """
    X = np.diag([1e6, 1e6, weak, 300.0])
    X[2, 3] = 0.3 * weak
    information = X.T @ X
    return information, information @ like


@given(st.floats(10.0, 200.0), st.tuples(*[st.floats(-0.02, 0.02)] * 2))
def test_a_figure_that_is_hardly_told_has_the_posterior_of_a_prior_as_wide_as_its_fellows_are_large(weak, z):
    information, pull = told(weak, np.array([1e-3, -2e-3, *z]))
    wide, size = np.full(3, 0.01), np.sqrt(0.5 * (1e-6 + 4e-6))
    values, covariance = posterior(information, pull, np.array([*wide, 0.01]))
    assume(abs(values[2]) < 1.99 * np.sqrt(covariance[2, 2]))
    dut = with_isotropic_prior(fit_of(CenterOfMassOffset(), values, covariance), priors=REAL.priors)
    mean, expected = posterior(information, pull, np.array([0.01, 0.01, size, 0.01]))
    np.testing.assert_allclose(dut.covariance, expected, rtol=1e-5, atol=1e-16)
    np.testing.assert_allclose(dut.values, mean, rtol=1e-4, atol=1e-9)
    assert list(dut.terms[0].effect.values.values()) == pytest.approx(list(dut.values[:3]))
    assert dut.calibration[0].effect.delta_mass == dut.values[3]


@pytest.mark.parametrize(
    ("effect", "size", "weak"),
    [(LinearDrag(), 1e-3, 50.0), (CenterOfMassOffset(), 1e-3, 1e6), (CenterOfMassOffset(), 0.1, 50.0)],
    ids=["figures with axes of their own", "told", "a prior that is no wider"],
)
def test_elsewhere_the_fit_stays(effect, size, weak):
    information, pull = told(weak, np.array([size, -2 * size, 5e-3, 0.0]))
    values, covariance = posterior(information, pull, np.full(4, 0.01))
    dut = with_isotropic_prior(fit_of(effect, values, covariance), priors=REAL.priors)
    np.testing.assert_array_equal(dut.values, values)
    np.testing.assert_array_equal(dut.covariance, covariance)
