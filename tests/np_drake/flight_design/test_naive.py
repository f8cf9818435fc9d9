"""Laws of the naive manoeuvres: as long as a design, from rest to rest, and within its limits."""

import numpy as np
import pytest

from np_drake.flight_design.motion import Basis
from np_drake.flight_design.naive import NAIVE, naive_motions

BASIS = Basis(10.0, 0.02)


@pytest.fixture(scope="module")
def motions(limits):
    return naive_motions(limits, BASIS, 0.8, 0)


@pytest.mark.parametrize("name", NAIVE)
def test_a_manoeuvre_rests_at_both_ends_and_keeps_its_limits(motions, limits, name):
    flat = motions[name].sample(BASIS.t)
    np.testing.assert_allclose(flat[1:3, [0, -1]], 0.0, atol=1e-6)
    used = max(limits.usage(BASIS.t, flat).values())
    assert used <= 0.82
    assert name == "hover" or used > 0.7


def test_the_names_are_those_of_the_motions(motions):
    assert tuple(motions) == NAIVE
