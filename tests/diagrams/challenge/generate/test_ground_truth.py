import dataclasses as dc

import numpy as np
import pytest
from diagrams.challenge.foreign_further import CeilingEffect

from diagrams.challenge.generate.case import FILES, CaseDraw, draw_case
from diagrams.challenge.generate.ground_truth import looks_like, pair_of, pairs_of, seen, unforeseen
from diagrams.challenge.generate.make import fly_case
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag

HELD_OUT = FILES[-1]


@pytest.fixture(scope="module")
def windy():
    """A case of a strong drag in gusts about a mean, flown without and with noise."""
    case = draw_case(CaseDraw(0, "single", ("linear_drag",)), quality="clean", seed=3, seconds=5.0)
    gusts = GustyWind(2.0, 0.0, 0.0, 1.0, 1.0)
    case = dc.replace(case, effects=(gusts, LinearDrag(0.3, 0.3, 0.3)))
    exact, noisy = fly_case(case, "drake")
    return case, exact[HELD_OUT], noisy[HELD_OUT]


def test_parameters_alone_do_not_tell_the_gusts(windy):
    case, exact, noisy = windy
    flight = pair_of(case, HELD_OUT, exact, noisy)
    noise, _ = seen(case, flight)
    left = unforeseen(case, flight, noise)
    gusts = np.sqrt(left[:2] ** 2 - noise[:2] ** 2)
    assert np.all((gusts > 0.1) & (gusts < 0.9))  # 0.3 N·s/m of a meter a second: not the drag, nor the mean
    assert left[3:] == pytest.approx(noise[3:], rel=0.05)


def test_what_has_no_chance_in_it_leaves_noise_alone(windy):
    case, exact, noisy = windy
    steady = dc.replace(case, effects=case.effects[1:])
    flight = pair_of(case, HELD_OUT, exact, noisy)
    noise, _ = seen(case, flight)
    assert unforeseen(steady, flight, noise) is noise


def test_a_flight_that_counts_later_for_its_noise_is_compared_from_there(windy):
    case, exact, noisy = windy
    shaken = noisy.rows(0, len(noisy))
    shaken.w[0] += 1.0  # [rad/s], as no rotors turn it in a row
    flight = pair_of(case, HELD_OUT, exact, shaken)
    assert flight.measured.t[0] > noisy.t[0]
    assert flight.true.t == pytest.approx(flight.measured.t)
    assert seen(case, flight)[0] == pytest.approx(
        seen(case, pair_of(case, HELD_OUT, exact, noisy))[0], rel=0.2
    )


@pytest.mark.parametrize(("height", "names"), [(0.0, "mass_error"), (2.5, None)])
def test_a_ceiling_is_a_mass_to_vehicles_that_stay_above_it(height, names):
    case = draw_case(CaseDraw(0, "foreign", ("ceiling_effect",)), quality="clean", seed=3, seconds=5.0)
    case = dc.replace(case, effects=(CeilingEffect(0.2, 0.5, height),))
    found = looks_like(case, pairs_of(case, *fly_case(case, "drake")))
    assert (names in found) if names else not found
