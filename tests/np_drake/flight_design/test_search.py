"""Laws of the search: seeded, within its limits, and never worse than where it began."""

import numpy as np
import pytest

from np_drake.flight_design.motion import Basis
from np_drake.flight_design.search import Search, projected

BASIS = Basis(6.0, 0.04)


def speed(motion) -> float:
    """Return the mean squared speed along y, of which the best is known to be large [m²/s²]."""
    return float(np.mean(motion.flat[1, :, 1] ** 2))


@pytest.fixture(scope="module")
def search(limits):
    return Search(limits, BASIS, 0.8, evaluations=60, seed=3)


def test_the_same_seed_gives_the_same_motion(search):
    (a, most), (b, again) = search.best(speed), search.best(speed)
    assert most == again
    np.testing.assert_array_equal(a.coefficients, b.coefficients)


def test_the_best_keeps_its_limits_and_beats_its_starts(search, limits):
    start = np.random.default_rng(4).normal(size=(BASIS.size, 3))
    best, most = search.best(speed, [start])
    assert most == speed(best) >= speed(search.sized(start))
    assert max(limits.usage(BASIS.t, best.flat).values()) <= 0.85


def test_the_refinement_gains_on_random_draws(search, limits):
    draws = Search(limits, BASIS, 0.8, evaluations=15, seed=3)
    assert search.best(speed)[1] > draws.best(speed)[1]


def test_the_budget_is_kept(search):
    calls = []
    search.best(lambda m: calls.append(1) or speed(m))
    assert len(calls) == 60


def test_a_motion_of_the_basis_is_its_own_projection(search):
    c = np.random.default_rng(5).normal(size=(BASIS.size, 3))
    motion = search.sized(c)
    again = BASIS.flat[0] @ projected(BASIS, motion.flat)
    np.testing.assert_allclose(again, motion.flat[0] - search.limits.center, atol=1e-6)


def test_the_search_ends_where_it_has_enough(search):
    calls = []
    _, most = search.best(lambda m: calls.append(1) or speed(m), enough=0.0)
    assert len(calls) == 1
    assert most >= 0.0
