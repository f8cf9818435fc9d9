import dataclasses as dc

import numpy as np
import pytest

from diagrams.challenge.case import FILES, CaseDraw, draw_case
from diagrams.challenge.make import fly_case
from diagrams.challenge.truth import seen, unforeseen
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag

HELD_OUT = FILES[-1]


@pytest.fixture(scope="module")
def windy():
    """A case of a strong drag in gusts about a mean, flown without and with noise."""
    case = draw_case(CaseDraw(0, "single", ("linear_drag",)), quality="clean", seed=3, seconds=5.0)
    gusts = GustyWind(2.0, 0.0, 0.0, 1.0, 1.0)
    case = dc.replace(case, effects=(gusts, LinearDrag(0.3, 0.3, 0.3)))
    return case, *fly_case(case, "drake")


def test_parameters_alone_do_not_tell_the_gusts(windy):
    case, exact, noisy = windy
    noise, _ = seen(case, exact[HELD_OUT], noisy[HELD_OUT])
    left = unforeseen(case, exact[HELD_OUT], noise)
    gusts = np.sqrt(left[:2] ** 2 - noise[:2] ** 2)
    assert np.all((gusts > 0.1) & (gusts < 0.9))  # 0.3 N·s/m of a meter a second: not the drag, nor the mean
    assert left[3:] == pytest.approx(noise[3:], rel=0.05)


def test_what_has_no_chance_in_it_leaves_noise_alone(windy):
    case, exact, noisy = windy
    steady = dc.replace(case, effects=case.effects[1:])
    noise, _ = seen(case, exact[HELD_OUT], noisy[HELD_OUT])
    assert unforeseen(steady, exact[HELD_OUT], noise) is noise
