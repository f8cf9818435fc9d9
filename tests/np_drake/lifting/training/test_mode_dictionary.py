import numpy as np
import pytest

from np_drake.lifting.training.linear_fits import horizon_grid
from np_drake.lifting.training.mode_dictionary import ModeDictionary, time_constants

HORIZONS = horizon_grid(200, 14)
DUT = time_constants((2.0, 10.0, 50.0), (2.0, 10.0, 50.0, 200.0), 1e4)


def test_readout_is_the_system_iterated():
    readout = DUT.readout(HORIZONS)
    for i, h in enumerate(HORIZONS):
        np.testing.assert_allclose(
            readout[i], DUT.C @ np.linalg.matrix_power(DUT.A, int(h)), atol=1e-12
        )


def test_a_course_made_of_the_modes_is_found_again():
    z = np.random.default_rng(0).standard_normal(DUT.K)
    projector = DUT.projector(HORIZONS, np.ones((len(HORIZONS), 2)), ridge=1e-14)
    np.testing.assert_allclose(
        np.einsum("khc,hc->k", projector, DUT.readout(HORIZONS) @ z), z, atol=1e-6
    )


def test_a_held_force_is_held_by_its_level():
    projector = DUT.projector(HORIZONS, np.ones((len(HORIZONS), 2)))
    z = np.einsum(
        "khc,hc->k", projector, np.tile([1.0, -2.0, 3.0, 0.0, 0.0, 0.0], (len(HORIZONS), 1))
    )
    course = DUT.readout(np.array([0, 100, 200])) @ z
    np.testing.assert_allclose(course[:, :3], [[1.0, -2.0, 3.0]] * 3, rtol=0.01)


@pytest.mark.parametrize("pole", [0.0, 1.0, 1.01])
def test_a_pole_that_does_not_decay_is_refused(pole):
    with pytest.raises(ValueError, match="inside"):
        ModeDictionary((np.array([pole]),) * 6)
