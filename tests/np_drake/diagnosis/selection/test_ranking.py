import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.regressors import Model
from np_drake.diagnosis.selection import names_of, names_of_fit, rank_models, score_of
from np_drake.diagnosis.selection.ranking import drop_negligible
from np_drake.effects.attitude_bias import AttitudeBias
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.thrust_scale import ThrustScale

BOTH = (MassError(0.2), LinearDrag(0.6, 0.6, 0.6))


@pytest.fixture(scope="module")
def dut(ranked):
    return ranked(*BOTH)


def test_the_best_fit_has_the_effects_that_act_and_their_figures(dut):
    assert names_of_fit(dut.fit) == ("linear_drag", "mass_error")
    found = {t.effect.identifier: t.effect for t in dut.fit.terms}
    assert found["mass_error"].delta_mass == pytest.approx(0.2, rel=0.03)
    for value in found["linear_drag"].values.values():
        assert value == pytest.approx(0.6, rel=0.1)


def test_probabilities_are_probabilities_and_sure_of_what_acts(dut):
    found = dut.ranking.probability
    assert all(0.0 <= p <= 1.0 + 1e-9 for p in found.values())
    assert found["mass_error"] > 0.99
    assert found["linear_drag"] > 0.99
    assert all(p < 0.5 for name, p in found.items() if name not in ("mass_error", "linear_drag"))


def test_the_fit_leaves_white_noise_of_unit_variance(dut):
    noise = dut.ranking.noise
    white = np.concatenate([noise.whiten(dut.fit.residual(e)) for e in dut.flights])
    np.testing.assert_allclose(np.mean(white**2, axis=0), 1.0, atol=0.1)


def test_effects_alone_are_searched(dut):
    assert not any(c.generic for c in dut.ranking.problem.candidates)
    assert not any(name.startswith("unknown") for name in dut.ranking.probability)


def test_the_best_fit_is_the_first(dut):
    scores = [score_of(f, dut.ranking.options.priors) for f in dut.ranking.fits]
    assert scores == sorted(scores, reverse=True)
    assert dut.ranking.best is dut.ranking.fits[0]


def test_every_fit_is_one_of_the_models_that_were_met(dut):
    met = {names_of(dut.ranking.problem, m) for m in dut.ranking.models}
    fitted = [names_of_fit(f) for f in dut.ranking.fits]
    assert set(fitted) <= met
    assert len(fitted) == len(set(fitted))


def test_a_large_offset_of_mass_needs_no_mass_as_its_second_order(ranked):
    dut = ranked(CenterOfMassOffset(0.012, 0.007, 0.006))
    assert names_of_fit(dut.fit) == ("center_of_mass_offset",)
    assert all(
        p < 0.5 for name, p in dut.ranking.probability.items() if name != "center_of_mass_offset"
    )


def test_the_model_is_tried_without_its_faint_effects_all_and_each(dut):
    names = ["mass_error", "linear_drag", "thrust_scale"]
    problem = dut.ranking.problem
    at = {c.identifiers[0]: i for i, c in enumerate(problem.candidates) if len(c.identifiers) == 1}
    members = tuple(at[name] for name in names)
    faint = dc.replace(dut.fit, terms=(*dut.fit.terms, Term(ThrustScale(0.9999))))
    tried = drop_negligible(problem, Model(members, 0.0), faint)
    assert [m.members for m in tried] == [members[:2]]
    for scale, tried_without in ((0.995, True), (0.99, False)):
        strong = dc.replace(dut.fit, terms=(*dut.fit.terms, Term(ThrustScale(scale))))
        assert bool(drop_negligible(problem, Model(members, 0.0), strong)) is tried_without


def test_the_largest_shift_of_commands_is_tried_and_none(dut):
    names = ["mass_error", "motor_lag", "command_delay"]
    problem = dut.ranking.problem
    at = {c.identifiers[0]: i for i, c in enumerate(problem.candidates) if len(c.identifiers) == 1}
    members = tuple(at[name] for name in names)
    for lag, delay, lesser in ((0.02, 0.06, "motor_lag"), (0.06, 0.02, "command_delay")):
        shifted = dc.replace(
            dut.fit, terms=(*dut.fit.terms, Term(MotorLag(lag)), Term(CommandDelay(delay)))
        )
        tried = drop_negligible(problem, Model(members, 0.0), shifted)
        most = tuple(i for i in members if i != at[lesser])
        assert {m.members for m in tried} == {most, members[:1]}


@pytest.mark.parametrize("delay", [0.047, 0.0512])  # [s], between two that are tried
def test_a_delay_between_those_that_are_tried_is_not_helped_by_a_lag(ranked, delay):
    assert names_of_fit(ranked(CommandDelay(delay)).fit) == ("command_delay",)


def test_two_effects_that_act_through_each_other_are_both_found(seen, searched):
    acting = (BladeFlapping(0.012), AttitudeBias(0.08, 0.02, -0.03))
    how = {"noise": 1.0, "seconds": 10.0, "vigour": (0.15, 0.15, 3.0, 0.5)}
    flights = [seen(*acting, name=str(i), seed=i, **how) for i in (1, 2)]
    assert names_of_fit(rank_models(searched(flights)).fits[0]) == (
        "attitude_bias",
        "blade_flapping",
    )
