"""Laws of the accelerations a reader works out, and of what it does with rotor speed."""

import dataclasses as dc

import numpy as np

from np_drake.rotor_input import rotor_speed, rotor_wrench
from np_drake.training_data.accelerations import (
    most_likely,
    rows_at,
    smooth_derivative,
    with_accelerations,
)
from np_drake.vehicle import Vehicle


def test_a_smooth_flight_is_differentiated_to_its_true_accelerations(flight):
    dut = with_accelerations(dc.replace(flight, a=None, al=None))
    inside = slice(30, -30)
    half = 0.5 * flight.step  # the mean over the interval after the row is the middle's value
    phase = 1.5 * (flight.t + half)[inside]
    np.testing.assert_allclose(dut.a[inside, 0], -2.25 * np.cos(phase), atol=1e-3)  # of 2.25 [m/s²]
    np.testing.assert_allclose(
        dut.al[inside], flight.al[inside], atol=0.02
    )  # half a row of 3.2 rad/s³ [rad/s²]
    assert "zero phase" in dut.notes[-1]
    assert "a, al" in dut.notes[-1]


def test_command_and_acceleration_stay_paired_under_differentiation():
    """Thrust that changes every row: with its own row the label is small, with a neighbour's it is
    not.
    """
    vehicle, n = Vehicle(), 2000
    draw = np.random.default_rng(3)
    command = 19.62 + np.convolve(draw.normal(size=n + 40), np.ones(41) / 41, "valid") * 10
    t = 0.01 * np.arange(n)
    v = np.cumsum(np.concatenate([[0.0], (command / vehicle.mass - 9.81)[:-1] * 0.01]))
    a = smooth_derivative(v[:, None], t, 15.0)[:, 0]
    error = [
        np.std((vehicle.mass * (a + 9.81) - np.roll(command, shift))[100:-100])
        for shift in (-1, 0, 1)
    ]
    assert error[1] < 0.7 * min(error[0], error[2])


def test_rotor_speed_and_command_are_inverse():
    vehicle = Vehicle()
    u = np.array([[19.62, 0.1, -0.2, 0.03], [25.0, 0.0, 0.3, -0.05]])
    np.testing.assert_allclose(rotor_wrench(vehicle, rotor_speed(vehicle, u)), u, atol=1e-12)


def test_a_step_picks_the_nearest_rows(flight):
    np.testing.assert_array_equal(rows_at(flight, 0.02), np.arange(0, len(flight), 2))
    rows = rows_at(flight, 0.025)
    assert len(rows) == 240
    half = 0.005 + 1e-12  # a row [s]
    np.testing.assert_allclose(flight.t[rows], 0.025 * np.arange(len(rows)), atol=half)


def test_noise_alone_goes_and_slow_motion_stays():
    t = 0.01 * np.arange(2000)
    slow = np.stack([np.sin(2 * np.pi * 0.7 * t), 0 * t], axis=1)
    values = slow + np.random.default_rng(0).normal(scale=[0.1, 0.1], size=slow.shape)
    missed = np.sqrt(np.mean((most_likely(values, np.array([0.1, 0.1]), 0.01) - slow) ** 2, axis=0))
    assert missed[0] < 0.03
    assert missed[1] < 0.02
    same = most_likely(values[:501], np.zeros(2), 0.01)  # read without noise
    np.testing.assert_allclose(same, values[:501], atol=1e-12)
