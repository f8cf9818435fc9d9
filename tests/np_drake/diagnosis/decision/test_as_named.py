"""Laws of an answer that is fitted as it is named."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.decision.infer import as_named
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.weak_rotor import WeakRotor

EFFECTS = (LinearDrag(0.3, 0.3, 0.3), WeakRotor(2.0, 0.9))


@pytest.fixture(scope="module")
def both(seen, inferred):
    flights = [
        seen(*EFFECTS, name=n, seed=i, noise=1.0, seconds=8.0) for i, n in enumerate("abc", start=1)
    ]
    return inferred(flights[:2], flights[2:])


def test_what_is_not_named_is_not_in_the_fit(both):
    (drag,) = (c for c in both.causes if c.identifier == "linear_drag")
    dut = as_named(dc.replace(both, causes=[drag]))
    assert [t.effect.identifier for t in dut.ranking.best.terms] == ["linear_drag"]
    assert dut.causes[0].effect == dut.ranking.best.terms[0].effect
    assert dut.causes[0].probability == drag.probability


def test_a_fit_without_an_effect_leaves_less_than_dropping_it(both):
    (drag,) = (c for c in both.causes if c.identifier == "linear_drag")
    best, noise = both.ranking.best, both.ranking.noise
    dropped = dc.replace(
        best, terms=tuple(t for t in best.terms if t.effect.identifier == "linear_drag")
    )
    fitted = as_named(dc.replace(both, causes=[drag])).ranking.best

    def left(fit):
        return sum(np.sum(e.white(noise, fit.residual(e)) ** 2) for e in both.flights)

    assert left(fitted) < left(dropped)
