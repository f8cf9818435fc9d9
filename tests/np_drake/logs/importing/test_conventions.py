"""Laws of the check of conventions: every error, and every pair, is named; what real flights do is
not refused.
"""

import itertools

import numpy as np
import pytest

from np_drake import attitude
from np_drake.effects.accelerometer_bias import AccelerometerBias
from np_drake.effects.attitude_bias import AttitudeBias
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.logs.importing.conventions import (
    Trial,
    WrongConventions,
    agreed,
    as_text,
    changed,
    check_conventions,
)
from np_drake.logs.importing.laws import FAILS, misfits, told_by_noise
from np_drake.logs.importing.log_map import BODIES, Source, axes_of_word, convert

ERRORS = {
    "ned": (("world", "ned"),),
    "frd": (("body", "frd"),),
    "ned_frd": (("world", "ned"), ("body", "frd")),
    "xyzw": (("attitude.order", "xyzw"),),
    "world_to_body": (("attitude.direction", "world_to_body"),),
    "degrees": (("rates.unit", "deg/s"),),
    "rates_frd": (("rates.body", "frd"),),
    "g": (("acceleration.unit", "g"),),
    "no_gravity": (("acceleration.kind", "acceleration"), ("acceleration.axes", "body")),
    "negative_acceleration": (("acceleration.scale", -1.0),),
    "negative_thrust": (("thrust.scale", -1.0),),
    "body_velocity": (("velocity.axes", "body"),),
    "millimetres": (("position.unit", "mm"),),
    "position_ned": (("position.world", "ned"), ("velocity.world", "ned")),
    "motion_capture_y_up": (("world", "eus"), ("attitude.body", "fur")),
}


@pytest.fixture(scope="module")
def sampled(excited, conventions):
    """Return times and quantities of the excited flight at 50 Hz."""
    x = conventions.quantities_of(excited)
    return excited.t[::2], {name: value[::2] for name, value in x.items()}


def checked(sampled, conventions, change):
    """Return the verdict on a log in other conventions than its map, and whether what it names is
    right.
    """
    t, x = sampled
    declared = conventions.plain_map()
    own = changed(declared, change)
    columns = conventions.columns_in(own, x)
    verdict = check_conventions(t, columns, declared)
    named = [
        same(convert(columns, changed(declared, fit)), x)
        for fit in (verdict.changes, *verdict.rivals)
    ]
    return verdict, named


def same(found, x):
    q = found["attitude"] * np.sign(
        np.sum(found["attitude"] * x["attitude"], axis=1, keepdims=True)
    )
    found = found | {"attitude": q}
    return all(np.allclose(found[name], value, atol=1e-6) for name, value in x.items())


def test_the_right_conventions_hold(sampled, conventions):
    verdict, _ = checked(sampled, conventions, ())
    assert not verdict.failed
    laws = {law.split()[0] for law in verdict.misfits}
    assert laws == {"position", "velocity", "attitude", "lift", "gravity", "upright", "thrust"}


@pytest.mark.parametrize("error", ERRORS)
def test_every_error_by_itself_is_named(sampled, conventions, error):
    verdict, named = checked(sampled, conventions, ERRORS[error])
    assert verdict.failed
    assert named[0], f"{as_text(verdict.changes)} for {error}"


@pytest.mark.parametrize("body", BODIES[1:])
def test_every_right_angle_between_attitude_and_gyro_is_named(sampled, conventions, body):
    verdict, named = checked(sampled, conventions, (("attitude.body", body),))
    assert verdict.failed
    assert named[0], as_text(verdict.changes)
    assert not verdict.rivals


@pytest.mark.parametrize("share", [0.02, 1.0])
def test_a_turn_is_named_however_little_moves_and_whatever_else_fails(sampled, conventions, share):
    t, x = sampled
    x = {name: x[name] for name in ("position", "velocity", "attitude", "rates")}
    small = share * attitude.rotation_vector(x["attitude"])
    x["attitude"], x["rates"] = attitude.from_rotation_vector(small), share * x["rates"]
    x["velocity"] = x["velocity"][::-1]  # as of another flight
    declared = conventions.plain_map()
    own = changed(declared, (("attitude.body", "lbu"),))
    verdict = check_conventions(t, conventions.columns_in(own, x), declared)
    assert verdict.failed[0] == "attitude axes"
    assert verdict.changes[0] == ("attitude.body", "lbu")


def test_the_refusal_tells_the_turn_and_the_line_that_mends_it(sampled, conventions):
    t, x = sampled
    declared = conventions.plain_map()
    columns = conventions.columns_in(changed(declared, (("attitude.body", "lbu"),)), x)
    verdict = check_conventions(t, columns, declared)
    with pytest.raises(WrongConventions, match=r"fits attitude.body: lbu \(.*by 90 deg about z\)"):
        agreed(verdict, {}, declared, "log.csv", adopt=False)


ANGLES = Source([f"attitude{i}" for i in range(3)])


@pytest.mark.parametrize("name, axis", [("attitude", 1), ("rates", 0)])
def test_a_single_column_of_the_other_hand_is_named_and_its_sign_turns_it(
    sampled, conventions, name, axis
):
    t, x = sampled
    declared = conventions.plain_map(attitude=ANGLES)
    columns = conventions.columns_in(declared, x)
    signs = [-1.0 if i == axis else 1.0 for i in range(3)]
    columns[name] = columns[name] * signs
    verdict = check_conventions(t, columns, declared)
    assert verdict.failed
    assert as_text(verdict.changes) == f"{name}.signs: {[int(sign) for sign in signs]}"
    turned = changed(declared, ((f"{name}.signs", signs),))
    assert not check_conventions(t, columns, turned).failed
    assert same(convert(columns, turned), x)


@pytest.mark.parametrize(
    "law, name, size", [("attitude z", "rates", 2.5), ("velocity x", "acceleration", 10.0)]
)
def test_one_axis_that_drifts_is_left_aside_and_not_refused(sampled, conventions, law, name, size):
    t, x = sampled
    axis = "xyz".index(law[-1])
    drift = np.zeros((len(t), 3))
    drift[:, axis] = size * np.sin(1.3 * t)
    x = {**x, name: x[name] + drift}
    verdict = check_conventions(
        t, conventions.columns_in(conventions.plain_map(), x), conventions.plain_map()
    )
    assert verdict.misfits[law] > FAILS
    assert told_by_noise(verdict.misfits) == [law]
    assert not verdict.failed
    assert told_by_noise({**verdict.misfits, law: 1.9}) == []  # the opposite sign
    other = f"{law[:-1]}{'xyz'[axis - 1]}"
    assert told_by_noise({**verdict.misfits, other: 0.8}) == []


FLIGHTS = {
    "payload": (SuspendedPayload(mass=0.4, length=0.8),),
    "wind and biases": (
        *(LinearDrag(0.5, 0.5, 0.3), ConstantWind(4.0, -2.0, 0.3), ClockOffset(0.05)),
        *(AccelerometerBias(0.3, -0.3, 0.4), AttitudeBias(0.05, -0.04, 0.06)),
    ),
}


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_gap_to_the_model_is_no_wrong_convention(fly, conventions, name):
    log = fly(*FLIGHTS[name], seed=5, seconds=10.0, noise=1.0, vigour=1.5, attitude_noise=0.01)
    x = conventions.quantities_of(log)
    columns = conventions.columns_in(
        conventions.plain_map(), {n: value[::2] for n, value in x.items()}
    )
    verdict = check_conventions(log.t[::2], columns, conventions.plain_map())
    assert not verdict.failed, verdict.misfits


def test_a_lift_turned_round_is_refused_also_where_nothing_else_fits(sampled, conventions):
    t, x = sampled
    x = {name: x[name] for name in ("position", "velocity", "attitude")}
    x["velocity"], x["position"] = (
        x["velocity"] * [-1, 1, 1],
        x["position"] * [-1, 1, 1],
    )  # left-handed
    verdict = check_conventions(t, x, conventions.plain_map())
    assert {law.split()[0] for law in verdict.failed} == {"lift"}


def test_a_trial_gives_the_misfits_of_a_whole_conversion(sampled, conventions):
    t, x = sampled
    declared = conventions.plain_map()
    columns = conventions.columns_in(declared, x)
    dut = Trial(t, columns)
    for names in [
        ("ned",),
        ("frd", "body_velocity"),
        ("xyzw", "no_gravity"),
        ("degrees", "ned_frd"),
        (),
    ]:
        own = changed(declared, tuple(itertools.chain(*(ERRORS[name] for name in names))))
        assert dut.misfits(own) == misfits(t, convert(columns, own), everything=True)


def test_a_flight_that_only_pitches_leaves_four_turns(sampled, conventions):
    t, x = sampled
    x = {name: x[name] for name in ("position", "attitude", "rates")}
    angle = 0.3 * np.sin(2 * np.pi * 0.7 * t)
    x["attitude"] = attitude.from_rotation_vector(angle[:, None] * [0.0, 1.0, 0.0])
    x["rates"] = np.gradient(angle, t)[:, None] * [0.0, 1.0, 0.0]
    declared = conventions.plain_map()
    columns = conventions.columns_in(changed(declared, (("attitude.body", "lbu"),)), x)
    verdict = check_conventions(t, columns, declared)
    own = axes_of_word("lbu")[1]
    fits = {fit[0][1] for fit in (verdict.changes, *verdict.rivals) if len(fit) == 1}
    assert {word for word in BODIES if (axes_of_word(word)[1] == own).all()} <= fits
    with pytest.raises(WrongConventions, match=r"; or .*; or .*; or ") as error:
        agreed(verdict, {}, declared, "log.csv", adopt=True)
    assert "--adopt" not in str(error.value)
