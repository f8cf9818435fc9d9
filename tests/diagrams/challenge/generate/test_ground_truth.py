import dataclasses as dc

import numpy as np
import pytest

from diagrams.challenge.generate.case import FILES, CaseDraw, draw_case
from diagrams.challenge.generate.flight_pair import AROUND, FlightPair, best_onset
from diagrams.challenge.generate.ground_truth import GroundTruth
from diagrams.challenge.generate.make import fly_case
from diagrams.challenge.out_of_library.ground_and_walls import CeilingEffect
from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.numerics import fit_noise
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.flight_log import FlightLog

ONSET = 7.0


@pytest.fixture(scope="module")
def hovering(vehicle):
    """Twelve seconds at rest under the thrust that holds the weight, as evidence."""
    t = np.arange(1200) / 100
    rest = np.zeros((len(t), 3))
    q = np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))
    u = np.tile([vehicle.mass * vehicle.gravity, 0.0, 0.0, 0.0], (len(t), 1))
    log = FlightLog(t, rest, q, rest, rest, u, a=rest, al=rest, name="hover")
    return make_flight_residuals(log, vehicle)


def told(evidence, strength, seed=1):
    rng = np.random.default_rng(seed)
    errors = 0.05 * rng.standard_normal(evidence.y.shape)
    terms = [Term(ThrustScale(1 - strength), {evidence.name: ONSET})]
    return best_onset(evidence, errors, terms, ONSET, fit_noise([errors], evidence.grid.step))


def test_what_is_plain_to_see_is_told_to_a_few_rows(hovering):
    assert told(hovering, 0.05) == pytest.approx(ONSET, abs=0.05)


def test_what_noise_hides_is_told_by_nobody(hovering):
    errors = [abs(told(hovering, 1e-4, seed) - ONSET) for seed in range(6)]
    assert np.median(errors) > 0.2
    assert max(errors) <= AROUND


def test_its_error_falls_with_the_strength(hovering):
    faint, plain = (
        np.mean([abs(told(hovering, strength, seed) - ONSET) for seed in range(6)])
        for strength in (1e-3, 2e-2)
    )
    assert plain < 0.5 * faint


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
    flight = FlightPair.of(case, HELD_OUT, exact, noisy)
    noise = flight.noise
    left = GroundTruth(case, {HELD_OUT: flight}).residual_of_true_parameters(HELD_OUT)
    gusts = np.sqrt(left[:2] ** 2 - noise[:2] ** 2)
    assert np.all(
        (gusts > 0.1) & (gusts < 0.9)
    )  # 0.3 N·s/m of a meter a second: not the drag, nor the mean
    assert left[3:] == pytest.approx(noise[3:], rel=0.05)


def test_what_has_no_chance_in_it_leaves_noise_alone(windy):
    case, exact, noisy = windy
    steady = dc.replace(case, effects=case.effects[1:])
    flight = FlightPair.of(case, HELD_OUT, exact, noisy)
    left = GroundTruth(steady, {HELD_OUT: flight}).residual_of_true_parameters(HELD_OUT)
    assert left is flight.noise


def test_a_flight_that_counts_later_for_its_noise_is_compared_from_there(windy):
    case, exact, noisy = windy
    shaken = noisy.rows(0, len(noisy))
    shaken.w[0] += 1.0  # [rad/s], as no rotors turn it in a row
    flight = FlightPair.of(case, HELD_OUT, exact, shaken)
    assert flight.measured.t[0] > noisy.t[0]
    assert flight.true.t == pytest.approx(flight.measured.t)
    assert flight.noise == pytest.approx(FlightPair.of(case, HELD_OUT, exact, noisy).noise, rel=0.2)


@pytest.mark.parametrize(("height", "names"), [(0.0, "mass_error"), (2.5, None)])
def test_a_ceiling_is_a_mass_to_vehicles_that_stay_above_it(height, names):
    case = draw_case(
        CaseDraw(0, "foreign", ("ceiling_effect",)), quality="clean", seed=3, seconds=5.0
    )
    case = dc.replace(case, effects=(CeilingEffect(0.2, 0.5, height),))
    found = GroundTruth.of(case, *fly_case(case, "drake")).equivalent_library_effects()
    assert (names in found) if names else not found
