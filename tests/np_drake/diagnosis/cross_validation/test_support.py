"""Laws of the support of a term by prediction."""

import numpy as np
import pytest

from np_drake.diagnosis.decision.infer import infer
from np_drake.diagnosis.decision.support import LEAST, Support, support_of
from np_drake.effects.linear_drag import LinearDrag

DRAG = LinearDrag(0.3, 0.3, 0.3)


def made(total, gains, held_out=()):
    gains = np.array(gains, float)
    return Support(total, gains, ("a",) * len(gains), np.array(held_out, float))


def test_a_steady_gain_is_sure_and_none_is_not():
    assert made(100.0, [10.0] * 10).probability > 0.99
    assert made(0.0, [0.0] * 10).probability < 0.5
    assert made(-50.0, [-5.0] * 10).probability < 0.01


def test_at_the_least_gain_it_is_even():
    assert made(LEAST, [LEAST / 10] * 10).probability == pytest.approx(0.5)


def test_a_gain_of_one_block_alone_is_less_sure_than_a_steady_one():
    assert made(30.0, [30.0] + [0.0] * 9).probability < made(30.0, [3.0] * 10).probability


def test_a_gain_in_one_flight_that_costs_another_is_not_sure():
    gains = np.array([10.0] * 5 + [-8.0] * 5)
    apart = Support(60.0, gains, ("a",) * 5 + ("b",) * 5, np.zeros(0))
    assert apart.probability < 0.7 < made(60.0, [6.0] * 10).probability


def test_held_out_flights_contradict_by_more_than_chance():
    assert not made(50.0, [5.0] * 10, [1.0, -1.5, 0.5]).contradicted
    assert made(50.0, [5.0] * 10, [-20.0, -22.0, -18.0]).contradicted
    assert not made(50.0, [5.0] * 10).contradicted


def test_a_drag_that_acts_predicts_every_flight_and_the_held_out_one(seen):
    flights = [
        seen(DRAG, name=n, seed=i, noise=1.0, seconds=8.0) for i, n in enumerate("abc", start=1)
    ]
    found = infer(flights[:2], flights[2:])
    fit, held = found.ranking.best, found.held
    names = [t.effect.identifier for t in fit.terms]
    supports = support_of(
        fit,
        found.flights,
        held.flights,
        held.whole_flight_terms,
        found.ranking.noise,
        found.options,
    )
    dut = supports[names.index("linear_drag")]
    assert dut.probability > 0.99
    assert min(dut.by_flight().values()) > 0
    assert dut.held_out.sum() > 0
