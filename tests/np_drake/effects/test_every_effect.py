"""What holds for each effect of the library, whatever it does."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.effects.base import ActuatorEffect, Measurement, Motion, SensorEffect, WrenchEffect
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.library import LIBRARY, NUISANCES, effects_for
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.logs.columns import COLUMNS
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
NOTHING = np.zeros(0)


def every(base, *, but=(), linear=False):
    known = (LIBRARY | NUISANCES).values()
    found = [e for e in known if issubclass(e, base) and e not in but]
    found = [e for e in found if e.linear or not linear]
    return pytest.mark.parametrize("effect", found, ids=[e.identifier for e in found])


def row(record, i):
    return type(record)(**{f.name: getattr(record, f.name)[i] for f in dc.fields(record)})


@every(WrenchEffect, but=(SuspendedPayload,))
def test_wrench_of_a_log_equals_wrench_row_by_row(effect, motion: Motion):
    dut = effect()
    rows = [dut.wrench(VEHICLE, row(motion, i)) for i in range(7)]
    np.testing.assert_allclose(dut.wrench(VEHICLE, motion), rows, atol=1e-12)
    winds = [dut.air_velocity(t) for t in motion.t]
    np.testing.assert_allclose(dut.air_velocity(motion.t), winds, atol=1e-12)
    assert np.abs(rows).max() + np.abs(winds).max() > 1e-3  # it does something


@pytest.mark.parametrize(
    "effect",
    [
        e
        for e in effects_for("rotor_speed").values()
        if issubclass(e, WrenchEffect) and e is not SuspendedPayload
    ],
)
def test_an_effect_that_says_so_has_no_force_or_no_torque(effect, motion: Motion):
    chi = effect().wrench(VEHICLE, motion)
    assert (chi[:, :3].any(), chi[:, 3:].any()) == (effect.pushes, effect.turns)


@every(WrenchEffect, but=(SuspendedPayload,))
def test_neutral_wrench_effect_does_nothing(effect, motion: Motion):
    dut = effect.neutral()
    np.testing.assert_array_equal(dut.wrench(VEHICLE, motion), np.zeros((7, 6)))
    np.testing.assert_array_equal(dut.air_velocity(motion.t), np.zeros((7, 3)))


@every(WrenchEffect, linear=True)
def test_wrench_effects_called_linear_are(effect, motion: Motion):
    once = effect().wrench(VEHICLE, motion)
    twice = effect.of({name: 2 * value for name, value in effect().values.items()})
    np.testing.assert_allclose(twice.wrench(VEHICLE, motion), 2 * once, rtol=1e-12)


@every(ActuatorEffect)
def test_thrust_of_a_log_equals_thrust_row_by_row(effect, motion: Motion):
    dut, command = effect(), motion.rotor_thrust
    state = dut.state_at(VEHICLE, command[0])
    rows = [dut.thrust(VEHICLE, state, command[i], motion.t[i]) for i in range(7)]
    many = np.broadcast_to(state, (7, len(state)))
    np.testing.assert_allclose(dut.thrust(VEHICLE, many, command, motion.t), rows, atol=1e-12)
    rates = [dut.state_rate(VEHICLE, state, c) for c in command]
    np.testing.assert_allclose(dut.state_rate(VEHICLE, many, command), rates, atol=1e-9)


@every(ActuatorEffect)
def test_neutral_actuator_passes_commands_on(effect, motion: Motion):
    t, dut = np.arange(7) * 0.01, effect.neutral()
    np.testing.assert_allclose(dut.respond(VEHICLE, t, motion.rotor_thrust), motion.rotor_thrust)
    assert dut.dead_time == 0.0


@every(ActuatorEffect)
def test_a_constant_command_meets_an_actuator_at_rest(effect):
    t, command = 3.0 + np.arange(50) * 0.01, np.tile([1.0, 2.0, 3.0, 4.0], (50, 1))
    dut = effect()
    expected = dut.thrust(VEHICLE, dut.state_at(VEHICLE, command[0]), command[0], t)
    if dut.state_size == 0:
        expected = dut.thrust(VEHICLE, NOTHING, command, t)
    np.testing.assert_allclose(dut.respond(VEHICLE, t, command), np.broadcast_to(expected, (50, 4)))


@every(SensorEffect)
def test_reading_of_a_log_equals_reading_row_by_row(effect, reading: Measurement):
    dut, white = effect(), np.zeros((7, 0))
    found = dut.measure(VEHICLE, reading, white)
    for i in range(7):
        alone = dut.measure(VEHICLE, row(reading, i), white[i])
        for field in ("x", "a", "al", "rotor"):
            np.testing.assert_allclose(getattr(found, field)[i], getattr(alone, field), atol=1e-12)


@every(SensorEffect)
def test_neutral_sensor_reads_the_truth(effect, reading: Measurement):
    found = effect.neutral().measure(VEHICLE, reading, np.zeros((7, 0)))
    for field in ("x", "a", "al", "rotor"):
        np.testing.assert_allclose(getattr(found, field), getattr(reading, field), atol=1e-15)
    assert effect.neutral().clock_shift == 0.0


@every(SensorEffect, but=(ClockOffset,))
def test_a_sensor_effect_touches_the_columns_that_it_names_and_no_other(
    effect, reading: Measurement
):
    found = effect().measure(VEHICLE, reading, np.zeros((7, 0)))
    names = [name for field in "pqvw" for name in COLUMNS[field]] + [*COLUMNS["a"], *COLUMNS["al"]]
    before, after = (np.concatenate([m.x, m.a, m.al], axis=1) for m in (reading, found))
    changed = {
        name for name, moved in zip(names, np.any(before != after, axis=0), strict=True) if moved
    }
    assert changed <= set(effect.corrupts)
    assert changed
    np.testing.assert_array_equal(found.rotor, reading.rotor)
