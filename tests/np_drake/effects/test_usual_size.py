"""Laws of the usual size of parameters and of their prior."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.effects.base import correlation_root, prior_root
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.library import LIBRARY
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.parameter import usual_size
from np_drake.effects.quadratic_drag import QuadraticDrag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle

PAPER = Vehicle()
HEAVY = dc.replace(PAPER, mass=3 * PAPER.mass)
WIDE = dc.replace(PAPER, rotor_positions=(2 * np.array(PAPER.rotor_positions)).tolist())
EVERY = pytest.mark.parametrize("effect", LIBRARY.values(), ids=LIBRARY.keys())


@pytest.mark.parametrize(
    "effect, heavy, wide",
    [
        (MassError, 3, 1),
        (LinearDrag, 3, 1),
        (QuadraticDrag, 3, 1),
        (CenterOfMassOffset, 1, 2),
        (GyroBias, 1, 1),
    ],
    ids=lambda v: getattr(v, "identifier", str(v)),
)
def test_a_size_goes_with_the_mass_or_the_arm_of_the_vehicle_by_its_unit(effect, heavy, wide):
    p = effect.parameters[0]
    assert usual_size(p, HEAVY) == pytest.approx(heavy * p.typical)
    assert usual_size(p, WIDE) == pytest.approx(wide * p.typical)


def test_a_tether_is_as_long_whatever_the_vehicle():
    length = next(p for p in SuspendedPayload.parameters if p.name == "length")
    assert usual_size(length, WIDE) == length.typical


@EVERY
def test_the_prior_has_the_usual_sizes_as_deviations(effect):
    root = prior_root(effect, HEAVY)
    sizes = [usual_size(p, HEAVY) for p in effect.parameters if not p.choices]
    np.testing.assert_allclose(np.sqrt(np.diag(root @ root.T)), sizes, rtol=1e-12)


@pytest.mark.parametrize("effect", [LinearDrag, QuadraticDrag])
def test_level_axes_of_a_drag_are_alike_and_others_are_uncorrelated(effect):
    root = correlation_root(effect)
    np.testing.assert_allclose(root @ root.T, effect.prior_correlation, rtol=1e-12)
    assert (root @ root.T)[0, 1] > 0.9 > (root @ root.T)[0, 2] > 0
    np.testing.assert_array_equal(correlation_root(GyroBias), np.eye(3))
