"""Laws of predicted residuals: true effects predict the residual of an exact log."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import NEVER, Term, predicted_residual
from np_drake.diagnosis.residuals import flight_residuals as ev
from np_drake.effects.base import SensorEffect
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.library import LIBRARY
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.vehicle import Vehicle

LAGGED = dc.replace(Vehicle(), rotor_time_constant=0.05)
INSIDE = slice(25, -25)  # of the grid: the ends are held
EVERY = pytest.mark.parametrize("effect", LIBRARY.values(), ids=LIBRARY.keys())
# Of the trace: what a step between instants, a smoothed regressor or the second order may cost [1].
INEXACT = {"suspended_payload": 0.06, "motor_lag": 0.02, "attitude_bias": 0.03}
LEFT = 5e-4  # of the trace for all others [1]
SMALL = 5e-4  # a channel that an effect does not touch [N, N·m]
LIGHT = SuspendedPayload(0.2, 0.35, 0.02, 0.0, -0.05)  # short: it does not swing up with the course


def made(effect: type) -> list:
    """Return the effect at its defaults, with the drag that it needs."""
    own = LIGHT if effect is SuspendedPayload else effect()
    return [LinearDrag(), own] if effect.needs else [own]


def size(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(values[INSIDE] ** 2, axis=1))))


@pytest.mark.parametrize("accelerations", [True, False])
@EVERY
def test_the_trace_of_the_true_effect_is_the_residual_of_an_exact_log(seen, effect, accelerations):
    acting = made(effect)
    dut = seen(*acting, accelerations=accelerations)
    residual = dut.y - predicted_residual(dut, [Term(e) for e in acting])
    share = INEXACT.get(effect.identifier, LEFT)
    for part in (ev.FORCE, ev.TORQUE):
        assert size(residual[:, part]) < share * size(dut.y[:, part]) + SMALL


def test_lagging_thrust_shows_between_velocity_and_acceleration(seen):
    dut = seen(MotorLag(0.05), seconds=8.0)
    residual = dut.y - predicted_residual(dut, [Term(MotorLag(0.05))])
    # a row is long for its kinks
    assert size(residual[:, ev.VELOCITY]) < 0.1 * size(dut.y[:, ev.VELOCITY])


@pytest.mark.parametrize("accelerations", [True, False])
@pytest.mark.parametrize("beside", [(), (ThrustScale(0.8),)], ids=["alone", "with weak rotors"])
def test_a_center_of_mass_turns_with_the_thrust_of_the_interval(seen, beside, accelerations):
    acting = [CenterOfMassOffset(0.012, 0.007, 0.006), *beside]
    dut = seen(*acting, accelerations=accelerations)
    residual = dut.y - predicted_residual(dut, [Term(e) for e in acting])
    assert size(residual[:, ev.TORQUE]) < 1e-6  # half a row of thrust at this lever is 5e-4 [N·m]


@pytest.mark.parametrize("accelerations", [True, False])
@pytest.mark.parametrize(
    "effect",
    [e for e in LIBRARY.values() if issubclass(e, SensorEffect)],
    ids=lambda e: e.identifier,
)
def test_the_trace_of_a_sensor_is_in_the_kinematic_channels_too(seen, effect, accelerations):
    dut = seen(effect(), accelerations=accelerations)
    residual = dut.y - predicted_residual(dut, [Term(effect())])
    for part in (ev.POSITION, ev.VELOCITY, ev.ATTITUDE):
        assert size(residual[:, part]) < 0.03 * size(dut.y[:, part]) + 1e-3  # [m/s, m/s², rad/s]


@EVERY
def test_a_neutral_effect_leaves_no_trace(seen, effect):
    dut = seen(noise=1.0)
    neutral = [LinearDrag(), effect.neutral()] if effect.needs else [effect.neutral()]
    found = predicted_residual(dut, [Term(e) for e in neutral])
    expected = predicted_residual(dut, [Term(LinearDrag())]) if effect.needs else 0 * found
    np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.fixture(scope="module")
def flown(seen):
    return seen(noise=1.0)


BEGINS = [e for e in LIBRARY.values() if e.begins]


@pytest.mark.parametrize("effect", BEGINS, ids=lambda e: e.identifier)
def test_before_its_onset_an_effect_leaves_no_trace_and_after_it_its_own(flown, effect):
    terms = [Term(e) for e in made(effect)]
    always = [dc.replace(t, onset={flown.name: None}) for t in terms]
    late = [dc.replace(t, onset={flown.name: 6.0}) for t in terms]
    found, whole = predicted_residual(flown, late), predicted_residual(flown, always)
    np.testing.assert_array_equal(predicted_residual(flown, terms), whole)
    # the low-pass sees 0.2 s ahead
    np.testing.assert_allclose(found[flown.t < 5.75], 0.0, atol=1e-9)
    if effect is not SuspendedPayload:  # which begins to swing anew
        after = flown.t > 6.25
        np.testing.assert_allclose(found[after], whole[after], atol=1e-9)
    never = [dc.replace(t, onset={flown.name: NEVER}) for t in terms]
    np.testing.assert_array_equal(predicted_residual(flown, never), 0.0)


@pytest.mark.parametrize(
    "effect", [MassError(), ThrustScale(), LinearDrag(), LIGHT], ids=lambda e: e.identifier
)
def test_an_onset_in_a_flight_leaves_the_trace_of_that_onset(seen, effect):
    dut = seen(effect, onset={effect.identifier: 5.0})
    residual = dut.y - predicted_residual(dut, [Term(effect, {dut.name: 5.0})])
    outside = np.abs(dut.t - 5.0) > 0.25
    # smoothing of the hook's motion blurs the start of the swing
    share = 0.1 if effect is LIGHT else 0.02
    assert size(residual[outside][:, ev.WRENCH]) < share * size(dut.y[:, ev.WRENCH])


def test_a_payload_pulls_by_the_load_that_hangs_then(flown):
    name, half = flown.name, dc.replace(LIGHT, mass=0.1)
    changes = {name: (3.0, NEVER, 6.0)}
    found = predicted_residual(flown, [Term(LIGHT, loads=(0.1, 9.0, 0.0), changes=changes)])
    first, second = (predicted_residual(flown, [Term(one)]) for one in (LIGHT, half))
    for part, expected in ((flown.t < 2.7, first), (flown.t > 6.3, 0.0 * first)):
        np.testing.assert_allclose(found[part], expected[part], atol=1e-9)
    between = (flown.t > 3.3) & (flown.t < 5.7)
    np.testing.assert_allclose(found[between], second[between], atol=1e-9)


def test_two_onsets_of_actuators_are_switched_in_one_after_the_other(flown):
    terms = [Term(ThrustScale(0.9), {flown.name: 3.0}), Term(CommandDelay(0.05), {flown.name: 6.0})]
    found = predicted_residual(flown, terms)
    scale = predicted_residual(flown, [Term(ThrustScale(0.9))])
    both = predicted_residual(flown, [Term(ThrustScale(0.9)), Term(CommandDelay(0.05))])
    between, late = (flown.t > 3.3) & (flown.t < 5.7), flown.t > 6.3
    np.testing.assert_allclose(found[between], scale[between], atol=1e-9)
    np.testing.assert_allclose(found[late], both[late], atol=1e-9)


@pytest.mark.parametrize("onset", [None, 2.0])
def test_mass_and_thrust_off_by_one_factor_leave_the_motion_as_it_was(seen, onset):
    dut = seen(vehicle=LAGGED, accelerations=True)
    begins = {dut.name: onset}
    factor = 0.5
    lighter = Term(MassError((factor - 1) * LAGGED.mass), begins)
    after = predicted_residual(dut, [lighter, Term(ThrustScale(factor), begins)])
    alone = predicted_residual(dut, [lighter])
    assert size(alone[:, ev.VELOCITY]) > 0.01
    assert size(after[:, ev.VELOCITY]) < 0.05 * size(alone[:, ev.VELOCITY])
    assert size(after[:, ev.FORCE]) < 0.05 * size(alone[:, ev.FORCE])


class InWorld(LinearDrag):
    def wrench(self, vehicle, motion):
        return super().wrench(vehicle, motion)


def test_a_law_in_the_world_predicts_as_one_in_the_body(seen):
    dut = seen(LinearDrag())
    found, known = (predicted_residual(dut, [Term(effect())]) for effect in (InWorld, LinearDrag))
    np.testing.assert_allclose(found, known, atol=1e-12)


def test_a_revised_flight_has_its_own_residuals_and_the_same_motion(seen):
    flown = seen(LinearDrag())
    terms = [Term(LinearDrag()), Term(LIBRARY["gyro_bias"](0.01, 0.0, 0.0))]
    known = predicted_residual(flown, terms)
    dut = flown.revised(y=flown.y - known)
    np.testing.assert_array_equal(dut.y, flown.y - known)
    np.testing.assert_array_equal(predicted_residual(dut, terms), known)
    assert dut.made is flown.made
