import dataclasses as dc

import numpy as np
import pytest

from diagrams.challenge.draw import FILES, CaseDraw, draw_case
from diagrams.challenge.make import fly_case
from diagrams.challenge.out_of_library import OutOfLibraryWrench
from diagrams.challenge.score import WIDEST
from diagrams.challenge.sensors import SEMANTICS, LoggedInput, SensorQuality
from diagrams.challenge.truth import AROUND, FlightPair, GroundTruth, best_onset
from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.numerics import fit_noise
from np_drake.diagnosis.regressors import tolerance_of
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.effects.air_speed import chi_from_body
from np_drake.effects.command_delay import CommandDelay
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


def wild_case(logged, *effects):
    """A wild case at 100 Hz with these effects and this input."""
    draw = CaseDraw(0, "single" if effects else "clean", tuple(e.identifier for e in effects))
    case = draw_case(draw, quality="wild", seed=3, seconds=5.0)
    quality = dc.replace(case.quality, rate=100.0, rotor=abs(case.quality.rotor))
    return dc.replace(case, quality=quality, input=logged, effects=effects)


@pytest.mark.parametrize(
    "effect, logged, expected",
    [
        (ThrustScale(0.96), LoggedInput(), True),  # 2.3 standard deviations of the file
        (ThrustScale(0.88), LoggedInput(), False),
        # A throttle's scale is known to a fifth.
        (ThrustScale(0.88), LoggedInput("normalised"), True),
        (CommandDelay(0.002), LoggedInput("command", "sampled"), True),  # the interval is 10 ms
        (CommandDelay(0.002), LoggedInput(), False),
        (LinearDrag(0.6, 0.6, 0.6), LoggedInput("command", "sampled"), False),
    ],
)
def test_what_the_files_may_be_off_by_must_not_be_named(effect, logged, expected):
    case = wild_case(logged, effect)
    truth = GroundTruth.of(case, *fly_case(case, "drake"))
    (flag,), (names,) = truth.within_tolerance(), truth.collinear_class()
    assert names[0] == effect.identifier
    assert flag is expected
    assert (len(names) > WIDEST) is expected  # it is the same as anything


def test_the_truth_tolerates_what_a_diagnosis_of_the_files_does():
    for logged in (LoggedInput("normalised", "sampled"), LoggedInput("command", "averaged")):
        one = wild_case(logged)
        truth = GroundTruth.of(one, *fly_case(one, "drake"))
        flights = [pair.measured for pair in truth.flights.values()]
        dut, throttle = truth.stated_tolerance(), logged.kind == "normalised"
        assert dut.mass == 0.0173
        assert dut.timing == pytest.approx(0.01 / np.sqrt(12), rel=0.05)
        assert (dut.thrust, dut.throttle_curve > 0) == (0.5 if throttle else 0.0173, throttle)
        real = dc.replace(truth, case=dc.replace(one, quality=SensorQuality("real")))
        assert real.stated_tolerance() == tolerance_of(flights)


def flown(logged):
    """A clean wild case with that input: its noisy log, noise floor and visibility in one
    flight.
    """
    case = wild_case(logged)
    exact, noisy = (logs[FILES[0]] for logs in fly_case(case, "drake"))
    flight = FlightPair.of(case, FILES[0], exact, noisy)
    return noisy, flight.noise, GroundTruth(case, {FILES[0]: flight}).visibility(FILES[0])


@pytest.mark.parametrize(
    "kind, semantics", [("thrust_only", "sampled"), ("rotor_speed", "averaged")]
)
def test_what_a_file_does_not_tell_is_no_gap(kind, semantics):
    noisy, noise, visibility = flown(LoggedInput(kind, semantics))
    assert noisy.input == kind
    assert visibility == pytest.approx(1.0, abs=0.05)  # nothing acts: no gap but noise
    assert (noise[3:6] == 0).all() == (kind == "thrust_only")


def test_the_truth_knows_when_commands_act():
    (held, floor, _), (late, same, _) = (flown(LoggedInput("command", s)) for s in SEMANTICS[:2])
    assert np.array_equal(held.u[:-1][np.diff(held.t) < 0.015], late.u[1:][np.diff(held.t) < 0.015])
    np.testing.assert_allclose(same, floor, rtol=1e-12)
