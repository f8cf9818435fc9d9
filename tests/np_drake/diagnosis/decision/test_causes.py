"""Laws of causes and minor findings: which effects of the best model are which, and how
probable.
"""

import dataclasses as dc

import numpy as np
import pytest
from scipy import special

from np_drake.diagnosis.decision import causes as module
from np_drake.diagnosis.decision.causes import causes_of, without_missing_drag
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

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)
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


def test_the_true_cause_is_named_with_its_parameters(judged_with):
    causes, minor = causes_of(*judged_with())
    (cause,) = causes
    assert minor == []
    assert cause.identifier == "linear_drag"
    assert cause.probability > 0.99
    assert cause.onset == {"a": None, "b": None, "c": None}
    for name in ("d_x", "d_y", "d_z"):
        estimate = cause.parameters[name]
        assert estimate.unit == "N·s/m"
        assert estimate.ci95[0] < 0.6 < estimate.ci95[1]
        assert estimate.value == pytest.approx(np.mean(estimate.ci95))
    assert cause.share == pytest.approx(1.0, abs=0.05)


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


def test_an_effect_too_small_to_matter_is_minor_unless_gusts_need_it(drag, judged_with):
    tiny = LinearDrag(1e-3, 1e-3, 1e-3)
    fit = drag.fit
    small = dc.replace(
        fit,
        terms=(dc.replace(fit.terms[0], effect=tiny),),
        values=np.r_[1e-3, 1e-3, 1e-3, fit.values[3:]],
        covariance=1e-4 * fit.covariance,
    )
    given = judged_with(fit=small)
    causes, minor = causes_of(*given)
    assert causes == []
    assert [f.name for f in minor] == ["linear_drag"]
    assert "immaterial" in minor[0].text
    assert "\n" not in minor[0].text
    assert [c.identifier for c in causes_of(*given, gusts=True)[0]] == ["linear_drag"]


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
