"""Laws of causes and minor findings: which effects of the best model are which, and how
probable.
"""

import dataclasses as dc

import numpy as np
import pytest
from scipy import special

from np_drake.diagnosis.decision import causes as module
from np_drake.diagnosis.decision.causes import causes_of, equivalents, without_missing_drag
from np_drake.diagnosis.decision.term_assessment import TermAssessment, assess_term
from np_drake.diagnosis.decision.unexplained import LinearModel
from np_drake.diagnosis.forward_model import pendulum_error
from np_drake.diagnosis.held_out import on_held_out
from np_drake.diagnosis.options import Options, Size
from np_drake.diagnosis.result import Cause
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.rotor_inflow import hover_induced_velocity
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


def test_probabilities_of_effects_that_cannot_be_told_apart_add(judged_with):
    shares = {"linear_drag": 0.5, "quadratic_drag": 0.3, "gyro_bias": 0.2}
    given = judged_with(probability=shares)
    assert assessed(*given).in_model == pytest.approx(0.5)
    assert assessed(*given, same=("quadratic_drag",)).in_model == pytest.approx(0.8)
    doubled = judged_with(probability={"linear_drag": 0.8, "quadratic_drag": 0.8})
    assert assessed(*doubled, same=("quadratic_drag",)).in_model == 1.0  # one model may hold both


@pytest.mark.parametrize("above, named", [(0.02, True), (-0.02, False)])
@pytest.mark.parametrize("options", [REAL, IDEAL], ids=["real", "ideal"])
def test_an_effect_is_a_cause_from_the_least_probability_on(judged_with, options, above, named):
    share = options.thresholds.cause_probability + above
    causes, minor = causes_of(*judged_with(options=options, probability={"linear_drag": share}))
    assert [c.identifier for c in causes] == ["linear_drag"] * named
    assert [f.name for f in minor] == ["linear_drag"] * (not named)
    assert all("not sure" in f.text for f in minor)


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


def test_a_drag_that_gusts_bring_has_their_prior_against_the_unknown(judged_with, monkeypatch):
    given = judged_with()
    ranking, linear, *_ = given
    margin = -4.0  # with the prior of a drag by itself
    monkeypatch.setattr(linear, "margin", lambda i, structure: margin)
    alone, blown = (
        assess_term(ranking, linear, (), 0, (), *given[3:], gusts=b) for b in (False, True)
    )
    priors = ranking.options.priors
    own = ranking.probability["linear_drag"]
    assert alone.in_model == pytest.approx(own * special.expit(margin))
    odds = margin - priors.effect + priors.generic
    assert blown.in_model == pytest.approx(own * special.expit(odds))
    assert causes_of(*given)[0] == []
    assert [c.identifier for c in causes_of(*given, gusts=True)[0]] == ["linear_drag"]


def test_an_effect_at_its_bound_is_minor_and_says_so(drag, judged_with):
    stuck = dc.replace(
        drag.fit, terms=(dc.replace(drag.fit.terms[0], effect=LinearDrag(0.6, 0.6, -0.2)),)
    )
    causes, minor = causes_of(*judged_with(fit=stuck))
    assert causes == []
    assert "bound" in minor[0].text
    assert minor[0].figures["probability"] == 0.0


@pytest.mark.parametrize(
    "effect, timing, within",
    [
        (CommandDelay(0.014), 0.01, True),
        (CommandDelay(0.014), 0.0, False),
        (CommandDelay(0.016), 0.01, False),
        (MotorLag(0.014), 0.01, True),
        (DRAG, 0.01, False),
    ],
    ids=lambda v: getattr(v, "identifier", str(v)),
)
def test_a_shift_of_commands_within_what_the_log_leaves_open_is_immaterial(
    fit_at, judged_with, effect, timing, within
):
    tolerance = dc.replace(REAL.tolerance, timing=timing)
    given = judged_with(
        fit=fit_at(effect, covariance=1e-6), options=dc.replace(REAL, tolerance=tolerance)
    )
    assert (assessed(*given).material == 0.0) is within


def cause(effect) -> Cause:
    return Cause(effect.identifier, 0.9, {}, {}, effect=effect)


def test_a_wind_without_a_drag_through_which_it_is_felt_is_minor():
    wind, mass, drag = (cause(e) for e in (ConstantWind(2.0), MassError(0.2), DRAG))
    causes, minor = without_missing_drag([wind, mass], [])
    assert causes == [mass]
    assert [f.name for f in minor] == ["constant_wind"]
    assert without_missing_drag([wind, drag], []) == ([wind, drag], [])


def test_without_torque_mass_and_thrust_are_named_beside_each_other(seen, searched):
    vertical = (0.0, 0.0, 1.0, 0.0)
    flights = [
        seen(MassError(0.2), name=n, seed=i, noise=1.0, seconds=8.0, vigour=vertical)
        for i, n in enumerate("ab")
    ]
    found = searched(flights)
    named = [found.problem.candidates[i].identifiers[0] for i in found.models[0].members]
    pair = {"mass_error", "thrust_scale"}
    (first,) = pair & set(named)
    (other,) = pair - {first}
    assert other in equivalents(found.problem, found.models[0])[first]


def test_what_the_motion_tells_apart_is_not_named_beside_it(drag):
    assert (
        "gyro_bias" not in equivalents(drag.ranking.problem, drag.ranking.models[0])["linear_drag"]
    )


def test_payload_parameters_are_known_no_better_than_the_pendulum_model(fit_at):
    payload = SuspendedPayload(0.2, 0.6, 0.0, 0.0, -0.05)
    exact, rough = (
        module._estimates(fit_at(payload, covariance=s), 0, PAPER, IDEAL.priors)
        for s in (1e-9, 0.01)
    )
    for name, estimate in exact.items():
        half = 0.5 * np.diff(estimate.ci95)[0]
        error = 1.96 * pendulum_error(name, payload, PAPER, IDEAL.priors)
        assert half == pytest.approx(error)
        assert 0.5 * np.diff(rough[name].ci95)[0] == pytest.approx(np.hypot(error, 1.96 * 0.01))


def test_a_damped_payload_may_weigh_more_by_what_the_downwash_pushes():
    still, damped = (SuspendedPayload(0.2, 0.6, 0.0, 0.0, -0.05, c) for c in (0.0, 0.1))
    share = 0.1 * hover_induced_velocity(PAPER) / PAPER.gravity
    for name, value in (("mass", 0.2), ("length", 0.6)):
        without, with_push = (pendulum_error(name, p, PAPER, IDEAL.priors) for p in (still, damped))
        assert with_push**2 - without**2 == pytest.approx((share * value) ** 2)
    hooks = [pendulum_error("hook_z", p, PAPER, IDEAL.priors) for p in (still, damped)]
    assert hooks[0] == hooks[1]


def test_a_reason_is_the_one_that_weighs_most():
    size = Size(0.0, 0.0, 0.0, 0.0)
    assert TermAssessment(0.9, 0.1, size, "").reason == "immaterial"
    assert "not sure" in TermAssessment(0.4, 1.0, size, "").reason
    assert TermAssessment(0.9, 0.1, size, "no drag pushes").reason == "no drag pushes"
