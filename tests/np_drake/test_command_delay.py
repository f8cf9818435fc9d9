"""Laws of the delay of commands: what acts when, and how it is told from motion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.command_delay import (
    FINE,
    KEPT,
    LONGEST_DELAY,
    DelayFilter,
    acting_command,
    commands_under_way,
)
from np_drake.rigid_body import state_derivative
from np_drake.rotor_input import rotor_decay, rotor_speed, rotor_wrench
from np_drake.vehicle import Vehicle

STEP, LAGGED = 0.02, Vehicle(rotor_time_constant=0.03)
LEVEL = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0, 0, 0, 0, 0, 0])
# command j has the value of its turn, the newest first
SENT = np.arange(KEPT, 0, -1.0)[:, None] * np.ones(4)


def flown(delays, *, noise=0.05, gust=0.0, known=0.0, track=True, seed=0, believed=LAGGED):
    """Return the delay believed after each sample of a restless command under `delays`."""
    draw, dut = (
        np.random.default_rng(seed),
        DelayFilter(believed, step=STEP, known=known, track=track),
    )
    memory, speed = dut.initial_memory(), rotor_speed(LAGGED, LAGGED.hover_input)
    sent, decay, found = [LAGGED.hover_input] * KEPT, rotor_decay(LAGGED, STEP / FINE), []
    for k, delay in enumerate(delays):
        u = LAGGED.hover_input + draw.normal(size=4) * [1.0, 0.1, 0.1, 0.02]
        sent = [u, *sent[:-1]]
        parts = round(FINE * delay)
        for i in range(FINE):  # the fine step that ends FINE - 1 - i of them before now
            command = sent[(parts + FINE - 1 - i) // FINE]
            speed = rotor_speed(LAGGED, command) + decay * (speed - rotor_speed(LAGGED, command))
        chi = gust * np.sin(3.0 * STEP * k) * np.array([1.0, 1, 1, 0.02, 0.02, 0])
        rate = state_derivative(LAGGED, LEVEL, rotor_wrench(LAGGED, speed), chi)
        measured = rate[7:13] + noise * draw.normal(size=6) * [1, 1, 1, 5, 5, 5]
        memory = dut.update(memory, x=LEVEL, acceleration=measured, u=u)
        found.append(dut.delay(memory))
    return np.array(found)


@pytest.mark.parametrize("parts", [0, 1, 6, 17, FINE * LONGEST_DELAY])
def test_the_delay_of_a_restless_command_is_told_within_a_second(parts):
    assert flown([parts / FINE] * 50, gust=1.0)[-1] == pytest.approx(parts * STEP / FINE)


def test_a_delay_that_changes_in_flight_is_followed_within_the_window():
    believed = flown([0.0] * 200 + [3.0] * 400)
    assert np.all(believed[:200] == 0.0)
    assert believed[300] == pytest.approx(3 * STEP, abs=1.01 * STEP / FINE)
    assert believed[-1] == pytest.approx(3 * STEP)


def test_noise_alone_shows_no_delay():
    dut, draw = DelayFilter(LAGGED, step=STEP), np.random.default_rng(1)
    memory = dut.initial_memory()
    for _ in range(3000):
        u = LAGGED.hover_input + draw.normal(size=4) * [1.0, 0.1, 0.1, 0.02]
        memory = dut.update(
            memory, x=LEVEL, acceleration=draw.normal(size=6) * [5, 5, 5, 50, 50, 50], u=u
        )
        assert dut.delay(memory) == 0.0


def test_a_delay_that_is_not_tracked_stays_as_given():
    assert np.all(flown([5.0] * 50, known=2 * STEP, track=False) == 2 * STEP)


def test_readings_of_nan_leave_the_delay():
    dut, memory = DelayFilter(LAGGED, step=STEP, known=STEP), None
    memory = dut.initial_memory()
    for x, a, u in ((np.nan, 0.0, 0.0), (0.0, np.nan, 0.0), (0.0, 0.0, np.nan)) * 5:
        memory = dut.update(
            memory, x=LEVEL + x, acceleration=np.zeros(6) + a, u=LAGGED.hover_input + u
        )
        assert dut.delay(memory) == STEP
        assert np.all(np.isfinite(memory["sent"]))
        assert np.all(np.isfinite(memory["acting"]))


@pytest.mark.parametrize("known", [-0.01, (LONGEST_DELAY + 0.5) * STEP, np.nan])
def test_an_impossible_delay_is_refused(known):
    with pytest.raises(ValueError, match="the delay must be 0 to"):
        DelayFilter(LAGGED, step=STEP, known=known)


@given(parts=st.integers(0, FINE * LONGEST_DELAY))
def test_what_acts_was_sent_a_delay_before(parts):
    """By brute force: the command of fine step i is the one sent `parts` fine steps before."""
    fine = np.repeat(SENT[::-1], FINE, axis=0)  # oldest first, up to now
    now = len(fine) - parts
    np.testing.assert_array_equal(commands_under_way(SENT, parts), fine[now:])
    np.testing.assert_allclose(
        acting_command(SENT, parts / FINE), fine[now - FINE : now].mean(axis=0)
    )


@pytest.mark.parametrize("delay", [0.0, 1.5])
def test_a_lag_that_is_not_known_is_not_taken_for_a_delay(delay):
    """The rotors lag by 30 ms and the filter is not told."""
    believed = flown([delay] * 300, believed=Vehicle())
    assert believed[-1] == pytest.approx(delay * STEP, abs=1.01 * STEP / FINE)
    assert believed.max() <= delay * STEP + 1.01 * STEP / FINE


def test_until_the_window_is_full_every_step_counts_alike():
    draw, dut = np.random.default_rng(3), DelayFilter(LAGGED, step=STEP)
    memories = [dut.initial_memory()]
    for _ in range(9):
        a, u = draw.normal(size=6), LAGGED.hover_input + draw.normal(size=4)
        memories.append(dut.update(memories[-1], x=LEVEL, acceleration=a, u=u))
    steps = np.diff([memory["error"] for memory in memories[1:]], axis=0)
    np.testing.assert_allclose(memories[-1]["squares"], np.mean(steps**2, axis=0))
