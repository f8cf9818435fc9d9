import dataclasses as dc

import numpy as np
import pytest

from diagrams.challenge.draw import FILES, CaseDraw, draw_case
from diagrams.challenge.make import fly_case
from diagrams.challenge.out_of_library import OutOfLibraryWrench
from diagrams.challenge.truth import AROUND, FlightPair, GroundTruth, best_onset
from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.numerics import fit_noise
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.effects.air_speed import chi_from_body
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


def ceiling(vehicle, motion, height):
    """Rotors give a fifth more just below the height, fading over half a metre."""
    near = np.exp(-np.maximum(height - motion.x[..., 2], 0.0) / 0.5)
    return chi_from_body(motion, (0.2 * motion.rotor_thrust.sum(-1) * near)[..., None] * [0, 0, 1])


@pytest.mark.parametrize(("height", "names"), [(0.0, "mass_error"), (2.5, None)])
def test_a_ceiling_is_a_mass_to_vehicles_that_stay_above_it(height, names):
    draw = CaseDraw(0, "foreign", ("wall_suction",))
    case = draw_case(draw, quality="clean", seed=3, seconds=5.0)
    case = dc.replace(case, effects=(OutOfLibraryWrench(ceiling, height=height),))
    found = GroundTruth.of(case, *fly_case(case, "drake")).equivalent_library_effects()
    assert (names in found) if names else not found


def test_a_class_holds_what_is_physically_the_same():
    draw = CaseDraw(0, "single", ("thrust_scale",))
    case = draw_case(draw, quality="clean", seed=3, seconds=5.0)
    case = dc.replace(case, effects=(ThrustScale(0.9),))
    truth = GroundTruth.of(case, *fly_case(case, "drake"))
    (names,) = truth.collinear_class()
    assert names[0] == "thrust_scale"
    assert "linear_drag" not in names
    nothing = dc.replace(case, effects=())
    dut = GroundTruth.of(nothing, *fly_case(nothing, "drake"))
    assert dut.collinear_class() == []
    assert dut.visibility(HELD_OUT) == pytest.approx(1.0, abs=0.05)
