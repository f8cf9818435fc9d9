"""Laws of the support of a term by prediction."""

import numpy as np

from np_drake.diagnosis.decision.support import Support, support_of
from np_drake.effects.linear_drag import LinearDrag

DRAG = LinearDrag(0.3, 0.3, 0.3)


def made(total, gains, held_out=()):
    gains = np.array(gains, float)
    return Support(total, gains, ("a",) * len(gains), np.array(held_out, float))


def test_a_steady_gain_is_sure_and_none_is_not():
    assert made(100.0, [10.0] * 10).probability > 0.99
    assert made(0.0, [0.0] * 10).probability < 0.5
    assert made(-50.0, [-5.0] * 10).probability < 0.01


def test_a_gain_in_one_flight_that_costs_another_is_not_sure():
    gains = np.array([10.0] * 5 + [-8.0] * 5)
    apart = Support(60.0, gains, ("a",) * 5 + ("b",) * 5, np.zeros(0))
    assert apart.probability < 0.7 < made(60.0, [6.0] * 10).probability


def test_held_out_flights_contradict_by_more_than_chance():
    assert not made(50.0, [5.0] * 10, [1.0, -1.5, 0.5]).contradicted
    assert made(50.0, [5.0] * 10, [-20.0, -22.0, -18.0]).contradicted
    assert not made(50.0, [5.0] * 10).contradicted


def test_a_drag_that_acts_predicts_every_flight_and_the_held_out_one(seen, inferred):
    flights = [
        seen(DRAG, name=n, seed=i, noise=1.0, seconds=8.0) for i, n in enumerate("abc", start=1)
    ]
    found = inferred(flights[:2], flights[2:])
    fit, held = found.ranking.best, found.held
    names = [t.effect.identifier for t in fit.terms]
    supports = support_of(
        fit,
        found.flights,
        held.flights,
        held.whole_flight_terms,
        found.ranking.noise,
        found.ranking.options,
    )
    dut = supports[names.index("linear_drag")]
    assert dut.probability > 0.99
    assert min(dut.gains[np.array(dut.flights) == name].sum() for name in "ab") > 0
    assert dut.held_out.sum() > 0
