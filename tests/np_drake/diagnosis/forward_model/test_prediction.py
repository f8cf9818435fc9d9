"""Laws of predicted residuals: true effects predict the residual of an exact log."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.diagnosis.forward_model import NEVER, StageCache, Term, gate, predicted_residual
from np_drake.diagnosis.residuals import flight_residuals as ev
from np_drake.effects.accelerometer_bias import AccelerometerBias
from np_drake.effects.attitude_bias import AttitudeBias
from np_drake.effects.base import SensorEffect
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.library import LIBRARY
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.quadratic_drag import QuadraticDrag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.effects.translational_lift import TranslationalLift
from np_drake.effects.velocity_bias import VelocityBias
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
    assert size(residual[:, ev.VELOCITY]) < 0.1 * size(
        dut.y[:, ev.VELOCITY]
    )  # a row is long for its kinks


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


def test_without_effects_there_is_no_trace(seen):
    np.testing.assert_array_equal(predicted_residual(seen(), []), 0.0)


FORCES = st.sampled_from([LinearDrag(), QuadraticDrag(), BladeFlapping(), TranslationalLift()])


@settings(max_examples=25, deadline=None)
@given(st.lists(FORCES, min_size=2, max_size=4, unique_by=type))
def test_traces_of_effects_that_do_not_feel_each_other_add(flown, effects):
    terms = [Term(e) for e in effects]
    np.testing.assert_allclose(
        predicted_residual(flown, terms),
        sum(predicted_residual(flown, [t]) for t in terms),
        atol=1e-9,
    )


@pytest.fixture(scope="module")
def flown(seen):
    return seen(noise=1.0)


def test_the_order_of_terms_does_not_matter(flown):
    terms = [
        Term(e)
        for e in (MassError(), LinearDrag(), ThrustScale(), MotorLag(), LIGHT, ConstantWind())
    ]
    np.testing.assert_allclose(
        predicted_residual(flown, terms), predicted_residual(flown, terms[::-1]), atol=1e-9
    )


@pytest.mark.parametrize(
    "effects",
    [
        (MassError(0.3), ThrustScale(0.9)),
        (LinearDrag(), ConstantWind(3.0, -1.0, 0.5)),
        (MotorLag(0.04), ThrustScale(1.1), BladeFlapping()),
        (MassError(0.3), LIGHT),
    ],
    ids=lambda e: "+".join(i.identifier for i in e),
)
def test_effects_that_feel_each_other_leave_their_common_trace(seen, effects):
    dut = seen(*effects)
    residual = dut.y - predicted_residual(dut, [Term(e) for e in effects])
    assert size(residual[:, ev.FORCE]) < 0.03 * size(dut.y[:, ev.FORCE])
    assert size(residual[:, ev.TORQUE]) < 0.05 * size(dut.y[:, ev.TORQUE]) + SMALL


@pytest.mark.parametrize(
    ("force", "sensor", "part"),
    [
        (QuadraticDrag(), VelocityBias(0.4, -0.3, 0.2), ev.FORCE),
        (LinearDrag(0.8, 0.4, 0.1), AttitudeBias(0.0, 0.0, 0.03), ev.FORCE),
        (InertiaError(1.3, 0.8, 1.2), GyroBias(0.1, -0.2, 0.3), ev.TORQUE),
    ],
    ids=lambda e: getattr(e, "identifier", ""),
)
def test_a_force_is_that_of_the_motion_and_not_of_its_reading(seen, force, sensor, part):
    dut = seen(force, sensor)
    alone = predicted_residual(dut, [Term(force)]) + predicted_residual(dut, [Term(sensor)])
    together = predicted_residual(dut, [Term(force), Term(sensor)])
    residual = [size((dut.y - trace)[:, part]) for trace in (alone, together)]
    assert residual[1] < 0.5 * residual[0]


def test_a_payload_swings_with_the_motion_whatever_the_accelerometer_reads(seen):
    sensor = AccelerometerBias(0.3, -0.4, 0.5)
    dut = seen(LIGHT, sensor)
    residual = dut.y - predicted_residual(dut, [Term(LIGHT), Term(sensor)])
    exact = seen(LIGHT)
    expected = exact.y - predicted_residual(exact, [Term(LIGHT)])
    assert size((residual - expected)[:, ev.FORCE]) < 2e-3 * size(exact.y[:, ev.FORCE])


def test_a_gyroscope_that_errs_leaves_a_torque(seen):
    bias = GyroBias(0.1, -0.2, 0.3)
    dut = seen(bias)
    residual = dut.y - predicted_residual(dut, [Term(bias)])
    assert size(residual[:, ev.TORQUE]) < 0.05 * size(dut.y[:, ev.TORQUE])


def test_wind_alone_leaves_no_trace(flown):
    np.testing.assert_array_equal(predicted_residual(flown, [Term(ConstantWind())]), 0.0)


BEGINS = [e for e in LIBRARY.values() if e.begins]


@pytest.mark.parametrize("effect", BEGINS, ids=lambda e: e.identifier)
def test_before_its_onset_an_effect_leaves_no_trace_and_after_it_its_own(flown, effect):
    terms = [Term(e) for e in made(effect)]
    always = [dc.replace(t, onset={flown.name: None}) for t in terms]
    late = [dc.replace(t, onset={flown.name: 6.0}) for t in terms]
    found, whole = predicted_residual(flown, late), predicted_residual(flown, always)
    np.testing.assert_array_equal(predicted_residual(flown, terms), whole)
    np.testing.assert_allclose(
        found[flown.t < 5.75], 0.0, atol=1e-9
    )  # the low-pass sees 0.2 s ahead
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
    share = (
        0.1 if effect is LIGHT else 0.02
    )  # smoothing of the hook's motion blurs the start of the swing
    assert size(residual[outside][:, ev.WRENCH]) < share * size(dut.y[:, ev.WRENCH])


@pytest.mark.parametrize("accelerations", [True, False])
@pytest.mark.parametrize("at", [5.0, 5.01], ids=["on the grid", "between"])
def test_what_begins_at_a_row_turns_the_vehicle_from_the_next_interval(seen, accelerations, at):
    effect = CenterOfMassOffset(0.012, 0.007, 0.006)
    dut = seen(effect, onset={effect.identifier: at}, accelerations=accelerations)
    residual = dut.y - predicted_residual(dut, [Term(effect, {dut.name: at})])
    assert size(residual[:, ev.TORQUE]) < 1e-3 * size(dut.y[:, ev.TORQUE])


def test_two_onsets_of_actuators_are_switched_in_one_after_the_other(flown):
    terms = [Term(ThrustScale(0.9), {flown.name: 3.0}), Term(CommandDelay(0.05), {flown.name: 6.0})]
    found = predicted_residual(flown, terms)
    scale = predicted_residual(flown, [Term(ThrustScale(0.9))])
    both = predicted_residual(flown, [Term(ThrustScale(0.9)), Term(CommandDelay(0.05))])
    between, late = (flown.t > 3.3) & (flown.t < 5.7), flown.t > 6.3
    np.testing.assert_allclose(found[between], scale[between], atol=1e-9)
    np.testing.assert_allclose(found[late], both[late], atol=1e-9)


def test_an_onset_belongs_to_its_flight(flown):
    elsewhere = Term(MassError(), {"another": NEVER})
    np.testing.assert_array_equal(
        predicted_residual(flown, [elsewhere]), predicted_residual(flown, [Term(MassError())])
    )


def test_the_gate_opens_at_the_onset():
    t = np.array([0.0, 1.0, 2.0])
    np.testing.assert_array_equal(gate(t, None)[:, 0], [1, 1, 1])
    np.testing.assert_array_equal(gate(t, 1.0)[:, 0], [0, 1, 1])
    np.testing.assert_array_equal(gate(t, NEVER)[:, 0], [0, 0, 0])


def test_more_mass_pulls_the_residual_down_by_its_share_of_the_thrust(flown):
    found = predicted_residual(flown, [Term(MassError(0.5))])
    expected = (2.0 / 2.5 - 1.0) * flown.nominal[:, 2]
    np.testing.assert_allclose(found[:, 2], expected, rtol=1e-9)
    np.testing.assert_allclose(found[:, [0, 1, 3, 4, 5]], 0.0, atol=1e-9)


def test_parts_that_are_kept_change_no_signature(seen):
    flight = seen(name="1", seed=1, seconds=5.0)
    stages = StageCache()
    acting = [
        LinearDrag(),
        MotorLag(0.02),
        ThrustScale(0.9),
        MassError(0.2),
        GyroBias(0.02, 0.0, 0.0),
    ]
    acting += [
        AttitudeBias(0.01, 0.0, 0.0),
        ConstantWind(2.0, 0.0, 0.0),
        CenterOfMassOffset(0.01),
        LIGHT,
    ]
    moved = [
        LinearDrag(0.4),
        MotorLag(0.05),
        ThrustScale(1.1),
        MassError(0.1),
        GyroBias(0.01, 0.01, 0.0),
    ]
    moved += [
        AttitudeBias(0.0, 0.01, 0.0),
        ConstantWind(0.0, 1.0, 0.0),
        CenterOfMassOffset(0.0, 0.01),
    ]
    moved += [SuspendedPayload(0.1, 0.5)]
    for i in range(len(acting)):
        for onset in ({}, {"1": 2.0}):
            now = [Term(e) for e in (*acting[:i], *acting[i + 1 :])] + [Term(moved[i], onset)]
            np.testing.assert_array_equal(
                predicted_residual(flight, now, stages), predicted_residual(flight, now)
            )


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
