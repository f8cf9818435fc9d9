"""Laws of the correlated prior of drag coefficients."""

import numpy as np
import pytest

from np_drake.diagnosis.fitting import free_parameters, prior_whitening
from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.options import Options
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


@pytest.mark.parametrize("effect", [LinearDrag, QuadraticDrag, GyroBias])
def test_whitened_deviations_of_the_prior_are_independent(flight, effect):
    terms = [Term(GyroBias()), Term(effect())]
    free = free_parameters(terms, [flight], {}, PRIORS)
    W, root = prior_whitening(terms, free), prior_root(effect, flight.vehicle)
    scaled = root / np.array([f.scale for f in free if f.term == 1])[:, None]
    np.testing.assert_allclose(W[3:, 3:] @ scaled, np.eye(3), atol=1e-12)
    np.testing.assert_array_equal(W[:3], np.eye(6)[:3])
