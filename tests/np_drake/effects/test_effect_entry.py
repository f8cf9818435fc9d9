"""Laws of the joint posterior of several effects' parameters, and of draws from it."""

import numpy as np
import pytest

from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.effect_entry import EffectEntry, Posterior
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError

DRAWS = 4000
CHANCE = 4.5  # standard errors that draws may be off
NAMES = ["mass_error.delta_mass", "linear_drag.d_x", "linear_drag.d_z"]
# Deviations that differ by a factor of 25, one pair strongly correlated.
DEVIATION = np.array([0.01, 0.02, 0.25])
CORRELATION = np.array([[1.0, 0.8, -0.3], [0.8, 1.0, 0.1], [-0.3, 0.1, 1.0]])
C = CORRELATION * np.outer(DEVIATION, DEVIATION)
MEAN = np.array([0.2, 1.0, 1.5])
ENTRIES = [EffectEntry.of(MassError(0.2)), EffectEntry.of(LinearDrag(1.0, 0.3, 1.5))]


def draws(posterior: Posterior, entries, count: int = DRAWS):
    rng = np.random.default_rng(7)
    return [posterior.draw(entries, rng) for _ in range(count)]


def test_draws_have_the_mean_of_the_effects_and_the_stated_covariance():
    drawn = draws(Posterior(NAMES, C.tolist()).check(), ENTRIES)
    values = np.array([[m.made.delta_mass, d.made.d_x, d.made.d_z] for m, d in drawn])
    scaled = (values - MEAN) / DEVIATION
    assert (np.abs(scaled.mean(axis=0)) < CHANCE / np.sqrt(DRAWS)).all()
    np.testing.assert_allclose(np.cov(scaled.T), CORRELATION, atol=CHANCE * np.sqrt(2 / DRAWS))
    assert {d.made.d_y for _, d in drawn} == {0.3}  # it has no covariance


def test_an_effect_acts_with_its_probability():
    unsure = [EffectEntry.of(MassError(0.2), probability=0.3), EffectEntry.of(LinearDrag())]
    drawn = draws(Posterior(), unsure)
    share = np.mean([len(entries) == 2 for entries in drawn])
    assert share == pytest.approx(0.3, abs=CHANCE * np.sqrt(0.21 / DRAWS))
    assert all(entries[-1].effect == "linear_drag" for entries in drawn)


def test_a_wind_without_the_drag_through_which_it_acts_is_left_out():
    unsure = [
        EffectEntry.of(ConstantWind(2.0, 0.0, 0.0)),
        EffectEntry.of(LinearDrag(), probability=0.5),
    ]
    drawn = {tuple(e.effect for e in entries) for entries in draws(Posterior(), unsure, 50)}
    assert drawn == {("constant_wind", "linear_drag"), ()}


@pytest.mark.parametrize(
    "names, matrix",
    [
        (["mass_error.delta_mass"], [[1.0, 0.0], [0.0, 1.0]]),
        (NAMES[:2], [[1.0, 0.5], [0.4, 1.0]]),
        (NAMES[:2], [[1e-6, 2e-3], [2e-3, 1.0]]),
        (["none.delta_mass"], [[1.0]]),
    ],
    ids=["size", "asymmetric", "correlation of 2", "effect"],
)
def test_what_is_no_covariance_of_parameters_is_refused(names, matrix):
    with pytest.raises(ValueError, match="posterior: "):
        Posterior(names, matrix).check()
