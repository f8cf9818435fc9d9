"""Laws of causes and minor findings: which effects of the best model are which, and how
probable.
"""

import dataclasses as dc

import numpy as np
import pytest
from scipy import special

from np_drake.diagnosis.decision import causes as module
from np_drake.diagnosis.decision.causes import without_missing_drag
from np_drake.diagnosis.decision.term_assessment import TermAssessment, assess_term
from np_drake.diagnosis.decision.unexplained import LinearModel
from np_drake.diagnosis.forward_model import pendulum_error
from np_drake.diagnosis.held_out import on_held_out
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.result import Cause
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle

IDEAL = Options.for_sensors(False)
DRAG = LinearDrag(0.6, 0.6, 0.6)
PAPER = Vehicle()


@pytest.fixture(scope="module")
def drag(ranked):
    return ranked(DRAG)


@pytest.fixture(scope="module")
def linear(drag):
    return LinearModel(drag.ranking)


@pytest.fixture(scope="module")
def judged_with(drag, linear):
    """Return the arguments of `causes_of` for the flights with drag, under another fit or
    options.
    """

    def arguments(fit=None, options=None, probability=None):
        ranking = drag.ranking
        ranking = dc.replace(
            ranking,
            fits=(fit or ranking.best,),
            options=options or ranking.options,
            probability=probability or ranking.probability,
        )
        held = on_held_out(ranking.best, drag.held_out, ranking.noise, ranking.options.priors)
        return ranking, linear, (), held

    return arguments


def assessed(ranking, linear, structure, held, same=()) -> TermAssessment:
    return assess_term(ranking, linear, structure, 0, same, held)


def test_a_probability_is_that_of_the_model_its_margin_and_its_size(judged_with):
    ranking, linear, *rest = judged_with(probability={"linear_drag": 0.8})
    found = assessed(ranking, linear, *rest)
    assert found.in_model == pytest.approx(0.8 * special.expit(linear.margin(0, ())))
    assert found.material == 1.0
    assert found.probability == pytest.approx(found.in_model)
    assert dc.replace(found, material=0.5).probability == pytest.approx(0.5 * found.in_model)
    assert dc.replace(found, stands_for="no drag pushes").probability == 0.0


def cause(effect) -> Cause:
    return Cause(effect.identifier, 0.9, {}, {}, effect=effect)


def test_a_wind_without_a_drag_through_which_it_is_felt_is_minor():
    wind, mass, drag = (cause(e) for e in (ConstantWind(2.0), MassError(0.2), DRAG))
    causes, minor = without_missing_drag([wind, mass], [])
    assert causes == [mass]
    assert [f.name for f in minor] == ["constant_wind"]
    assert without_missing_drag([wind, drag], []) == ([wind, drag], [])


def test_payload_parameters_are_known_no_better_than_the_pendulum_model(fit_at):
    payload = SuspendedPayload(0.2, 0.6, 0.0, 0.0, -0.05)
    exact, rough = (
        module.estimates(fit_at(payload, covariance=s), 0, PAPER, IDEAL.priors)
        for s in (1e-9, 0.01)
    )
    for name, estimate in exact.items():
        half = 0.5 * np.diff(estimate.ci95)[0]
        error = 1.96 * pendulum_error(name, payload, PAPER, IDEAL.priors)
        assert half == pytest.approx(error)
        assert 0.5 * np.diff(rough[name].ci95)[0] == pytest.approx(np.hypot(error, 1.96 * 0.01))
