"""Laws of the frequency and damping of a fitted resonance."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.fitting.map_estimate import Generic
from np_drake.diagnosis.fitting.resonance_fit import mode_of
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors.generic import PREFIX, generic_candidates

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)


@pytest.fixture(scope="module")
def swinging(seen):
    """Return nominal flights with the columns of one frequency and damping added, and the nearest grid candidate."""

    def made(name: str, frequency: float, damping: float):
        flights = [seen(name=str(i), seed=i, noise=1.0, seconds=12.0) for i in (1, 2)]
        groups = [
            c for c in generic_candidates(flights, priors=REAL.priors) if c.identifiers == (PREFIX + name,)
        ]
        nearest = min(groups, key=lambda c: abs(np.log(c.figures["frequency"] / frequency)))
        size = nearest.swing(frequency, damping, flights[0]).shape[-1]
        gains = np.random.default_rng(3).normal(size=size)
        flights = [dc.replace(e, y=e.y + 3.0 * nearest.swing(frequency, damping, e) @ gains) for e in flights]
        return flights, Generic(nearest, np.zeros(nearest.size))

    return made


@pytest.mark.parametrize("name", ["resonance", "twist"])
@pytest.mark.parametrize("frequency, damping", [(0.9, 0.2), (2.1, 0.06), (3.5, 0.12)])
def test_frequency_and_damping_of_what_swings_are_found_between_those_of_the_grid(
    swinging, noise, name, frequency, damping
):
    flights, generic = swinging(name, frequency, damping)
    found, damped = mode_of(generic, flights, {e.name: e.y for e in flights}, noise) or (0.0, 0.0)
    assert found == pytest.approx(frequency, rel=0.03)
    assert damped == pytest.approx(damping, rel=0.25)


def test_the_mode_is_that_of_what_a_fit_explains_by_it_and_of_what_it_leaves(swinging, noise):
    flights, generic = swinging("twist", 2.1, 0.06)
    y = {e.name: e.y for e in flights}
    whole = mode_of(generic, flights, y, noise)
    fitted = Generic(generic.candidate, np.random.default_rng(4).normal(size=generic.candidate.size))
    residual = {e.name: e.y - fitted.part(e) for e in flights}
    assert mode_of(fitted, flights, residual, noise) == pytest.approx(whole, rel=1e-6)


def test_a_mode_far_from_where_the_grid_found_it_is_none(swinging, noise):
    flights, generic = swinging("twist", 3.5, 0.1)
    far = dc.replace(generic.candidate, figures={"frequency": 1.5})
    residual = {e.name: e.y for e in flights}
    assert mode_of(dc.replace(generic, candidate=far), flights, residual, noise) is None


def test_what_does_not_swing_has_no_mode(seen, noise):
    flights = [seen(seconds=6.0)]
    place = next(c for c in generic_candidates(flights, priors=REAL.priors) if c.swing is None)
    with pytest.raises(ValueError, match="does not swing"):
        mode_of(Generic(place, np.zeros(place.size)), flights, {e.name: e.y for e in flights}, noise)
