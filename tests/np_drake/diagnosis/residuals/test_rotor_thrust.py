"""Laws of rotor thrust from logged commands."""

import dataclasses as dc

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.diagnosis.residuals.rotor_thrust import Rotors
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.flight_log import FlightLog
from np_drake.rotor_input import rotor_speed, rotor_wrench
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
STEP = 0.01


def log_of(thrust: np.ndarray) -> FlightLog:
    n = len(thrust)
    still = np.zeros((n, 3))
    q = np.tile([1.0, 0, 0, 0], (n, 1))
    return FlightLog(
        t=2.0 + STEP * np.arange(n), p=still, q=q, v=still, w=still, u=thrust @ VEHICLE.mixer.T
    )


def commands(seed: int = 0, n: int = 60) -> np.ndarray:
    return np.random.default_rng(seed).uniform(2.0, 8.0, (n, 4))


def test_a_command_is_held_from_its_row_to_the_next():
    f = commands()
    rows, mids = Rotors(log_of(f), VEHICLE).thrust([])
    np.testing.assert_allclose(rows, f, atol=1e-9)
    np.testing.assert_allclose(mids, f[:-1], atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(st.floats(0.0, 0.12), st.integers(0, 100))
def test_a_delay_mixes_two_commands_in_the_mean_of_an_interval(delay, seed):
    f = commands(seed)
    _, mids = Rotors(log_of(f), VEHICLE).thrust([CommandDelay(delay)])
    whole, part = divmod(delay / STEP, 1)
    k = np.arange(len(f) - 1) - int(whole)
    expected = (1 - part) * f[np.maximum(k, 0)] + part * f[np.maximum(k - 1, 0)]
    np.testing.assert_allclose(mids, expected, atol=1e-6)  # rounding of the substeps [N]


@settings(max_examples=25, deadline=None)
@given(st.floats(0.0, 0.12), st.integers(0, 100))
def test_a_late_clock_and_a_delay_shift_the_command_alike_and_once(delay, seed):
    log = log_of(commands(seed))
    by_delay = Rotors(log, VEHICLE).thrust([CommandDelay(delay)])
    by_clock = Rotors(log, VEHICLE).thrust([], shift=delay)
    np.testing.assert_allclose(by_clock[1], by_delay[1], atol=1e-6)
    np.testing.assert_allclose(by_clock[0], by_delay[0], atol=1e-6)


def test_a_lag_answers_a_step_as_an_exponential_of_rotor_speed():
    T, low, high = 0.04, 3.0, 6.0
    f = np.full((60, 4), low)
    f[20:] = high
    rows, mids = Rotors(log_of(f), VEHICLE).thrust([MotorLag(T)])
    since = STEP * np.arange(39)  # from row 20 on
    s0, s1 = np.sqrt(low), np.sqrt(high)
    e = np.exp(-since / T)

    def mean(power: int) -> np.ndarray:
        """Return the mean of e^(-power t / T) over the interval that begins at `since`."""
        return T / (power * STEP) * (1 - np.exp(-power * STEP / T)) * e**power

    expected = s1**2 + 2 * s1 * (s0 - s1) * mean(1) + (s0 - s1) ** 2 * mean(2)
    # Simpson's rule on a quarter of a row [N]
    np.testing.assert_allclose(mids[20:, 0], expected, atol=1e-5)
    np.testing.assert_allclose(mids[:20], low, atol=1e-9)
    at_rows = (s1 + (s0 - s1) * e) ** 2
    # continued over a quarter of a row [N]
    np.testing.assert_allclose(rows[20:59, 0], at_rows, atol=1e-3)


def test_measured_rotor_speed_is_between_rows_and_passes_propellers_only():
    # No fourth difference, so no noise.
    f = 5.0 + np.linspace(-1.0, 1.0, 60)[:, None] ** 3 * [1.0, -2.0, 0.5, 3.0]
    log = dc.replace(log_of(f), input="rotor_speed")
    chain = [MotorLag(0.05), CommandDelay(0.03), ThrustScale(0.9)]
    rows, mids = Rotors(log, VEHICLE).thrust(chain)
    at_rows, between = Rotors(log, VEHICLE).thrust([ThrustScale(0.9)])
    np.testing.assert_array_equal(rows, at_rows)
    np.testing.assert_array_equal(mids, between)
    np.testing.assert_allclose(rows, 0.9 * f, atol=1e-9)
    np.testing.assert_allclose(mids, 0.9 * 0.5 * (f[:-1] + f[1:]), atol=1e-6)


NOISE = 4.0  # of readings of rotor speed [rad/s]


def known(log: FlightLog) -> FlightLog:
    """Return the log with rotor speed at its rows in place of a held command, taken in the middle
    of its step.
    """
    at_rows = np.concatenate([log.u[:1], 0.5 * (log.u[1:] + log.u[:-1])])
    return dc.replace(log, u=at_rows, input="rotor_speed")


def test_likeliest_thrust_is_nearer_than_the_reading_and_its_noise_known(fly):
    log = fly(noise=1.0, seconds=20.0)
    spin = rotor_speed(VEHICLE, known(log).u)
    noisy = spin + NOISE * np.random.default_rng(0).normal(size=spin.shape)
    read = dc.replace(known(log), u=rotor_wrench(VEHICLE, noisy))
    true, seen = (x.u @ VEHICLE.unmixer.T for x in (known(log), read))
    found, noise = Rotors(read, VEHICLE)._read
    speed = np.mean(rotor_speed(VEHICLE, log.u), axis=0)
    of_rotors = 2 * VEHICLE.thrust_coefficient * NOISE * speed  # [N]
    np.testing.assert_allclose(noise, np.sqrt(VEHICLE.mixer**2 @ of_rotors**2), rtol=0.1)
    assert np.std(found - true) < 0.5 * np.std(seen - true)
