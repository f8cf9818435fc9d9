import dataclasses as dc

import pytest

from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors.library import effect_candidates, switched
from np_drake.diagnosis.regressors.regression_problem import Model, RegressionProblem
from np_drake.diagnosis.selection.change_point_refinement import refined_change_points
from np_drake.diagnosis.selection.ranking import names_of_fit, ranked
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.weak_rotor import WeakRotor

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)

HEAVY, DRAG = MassError(0.4), LinearDrag(0.6, 0.6, 0.6)


def late_problem(flights, noise, effect, onset, *others):
    """Candidates: the effect from the start, what else acts, and the effect from `onset` on."""
    candidates = [effect_candidates(type(e), flights, {})[0] for e in (effect, *others)]
    late = dc.replace(switched(candidates[0], flights, onset), onset_prior=-5.0)
    return RegressionProblem(flights, noise, [], [*candidates, late], temperature=1.0, options=REAL)


@pytest.mark.parametrize("found", [5.30, 5.32])
def test_an_onset_between_rows_of_the_grid_is_found_to_a_row_of_the_log(seen, noise, found):
    flights = [seen(HEAVY, name=n, seed=i, noise=1.0, onset={"mass_error": 5.31}) for i, n in enumerate("ab")]
    assert flights[0].log.step == pytest.approx(0.01)
    assert flights[0].grid.step == pytest.approx(0.02)
    problem = late_problem(flights, noise, HEAVY, {"a": found, "b": found})
    (dut,) = refined_change_points(problem, Model((1,), 0.0))
    assert dut.onset == pytest.approx({"a": 5.31, "b": 5.31}, abs=1e-6)
    assert dut.onset_prior == -5.0
    better = problem.beside([dut])
    assert better.score((2,)) > better.score((1,)) + 100.0


def test_what_is_sharp_already_is_not_said_again(seen, noise):
    flights = [seen(HEAVY, name="a", seed=1, noise=1.0, onset={"mass_error": 5.31})]
    begin = flights[0].log.t[531]
    assert refined_change_points(late_problem(flights, noise, HEAVY, {"a": begin}), Model((1,), 0.0)) == []


def test_what_acts_from_the_start_or_swings_stays_as_it_is(seen, noise):
    payload = SuspendedPayload(0.2, 0.5, 0.0, 0.0, -0.05)
    flights = [seen(payload, name="a", seed=1, noise=1.0, onset={"suspended_payload": 5.31})]
    problem = late_problem(flights, noise, HEAVY, {"a": 5.3})
    hung = dc.replace(problem.candidates[1], identifiers=("suspended_payload",))
    assert refined_change_points(problem.beside([hung]), Model((0, 2), 0.0)) == []


def test_it_is_sought_beside_what_else_acts_too(seen, noise):
    late = {"mass_error": 5.31}
    flights = [seen(HEAVY, DRAG, name="a", seed=1, noise=1.0, onset=late)]
    problem = late_problem(flights, noise, HEAVY, {"a": 5.3}, DRAG)
    found = [c.onset["a"] for c in refined_change_points(problem, Model((1, 2), 0.0))]
    assert found == pytest.approx([5.31], abs=1e-6)  # alone and beside agree: said once


def test_a_strong_effect_that_begins_between_rows_of_the_grid_brings_no_other_name(seen, searched):
    weak = WeakRotor(1, 0.8)
    flights = [seen(weak, name=n, seed=i, noise=1.0, onset={"weak_rotor": 5.31}) for i, n in enumerate("ab")]
    ranking = ranked(searched(flights))
    assert names_of_fit(ranking.fits[0]) == ("weak_rotor",)
    assert ranking.fits[0].terms[0].onset == pytest.approx({"a": 5.31, "b": 5.31}, abs=1e-6)
