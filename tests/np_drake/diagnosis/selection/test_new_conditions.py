"""Laws of conditions that the training flights did not have."""

import dataclasses as dc

import pytest

from np_drake.diagnosis.forward_model import NEVER
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.selection.change_point import new_conditions
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError

PRIORS = Options.for_sensors(True).priors
DRAG = LinearDrag(0.3, 0.3, 0.3)


@pytest.fixture(scope="module")
def windy(seen):
    """Two training flights in still air, and the half of a windy one that has joined."""
    flights = [seen(DRAG, name=n, seed=i, noise=1.0, seconds=8.0) for i, n in enumerate("ab")]
    half = seen(DRAG, ConstantWind(3.0, 1.0, 0.0), name="half", seed=2, noise=1.0, seconds=8.0)
    return [*flights, dc.replace(half, goes_on=True)]


def test_there_are_none_where_no_half_has_joined_or_nothing_else_flew(windy, searched):
    still, half = windy[:2], windy[2:]
    assert new_conditions(searched(still).problem) == []
    assert new_conditions(searched(half).problem) == []


def test_they_cost_one_absence_for_every_training_flight_without_them(windy, searched):
    problem = searched(windy).problem
    found = new_conditions(problem)
    assert found
    for candidate in found:
        assert candidate.onset == {"a": NEVER, "b": NEVER}
        assert candidate.onset_prior == pytest.approx(2 * PRIORS.onset)
        effects = {name for name in candidate.identifiers if name != "linear_drag"}
        for name in "ab":
            acting = (
                candidate.columns[name][..., 3:]
                if "constant_wind" in effects
                else candidate.columns[name]
            )
            assert not acting.any()
        assert candidate.columns["half"].any()


def test_a_wind_not_met_in_training_is_found_beside_a_drag_of_all(windy, searched):
    best = searched(windy).best
    terms = {t.effect.identifier: t for t in best.terms}
    assert terms["constant_wind"].onset == {"a": NEVER, "b": NEVER}
    assert terms["constant_wind"].effect.x == pytest.approx(3.0, abs=0.3)
    assert all(terms["linear_drag"].begins(e.name) is None for e in windy)


def test_a_mass_that_training_flights_did_not_have_is_found(seen, searched):
    flights = [seen(name=n, seed=i, noise=1.0, seconds=8.0) for i, n in enumerate("ab")]
    half = dc.replace(
        seen(MassError(0.2), name="half", seed=2, noise=1.0, seconds=8.0), goes_on=True
    )
    best = searched([*flights, half]).best
    (term,) = (t for t in best.terms if t.effect.identifier == "mass_error")
    assert term.onset == {"a": NEVER, "b": NEVER}
    assert term.effect.delta_mass == pytest.approx(0.2, abs=0.02)


def test_where_training_flights_are_known_to_be_calm_no_wind_acts_in_them(seen, searched):
    flights = [
        seen(DRAG, ConstantWind(2.0, 0.0, 0.0), name=n, seed=i, noise=1.0, seconds=8.0)
        for i, n in enumerate("ab")
    ]
    flights[1] = dc.replace(flights[1], goes_on=True)
    found = searched(flights, still_air=True)
    tried = [c for c in found.problem.candidates if "constant_wind" in c.identifiers]
    assert tried
    assert all(c.onset for c in tried)
    winds = [t for t in found.best.terms if t.effect.identifier == "constant_wind"]
    assert all(t.begins("a") is not None for t in winds)
