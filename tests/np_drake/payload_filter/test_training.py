"""Laws of the training of a pendulum predictor."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake import attitude
from np_drake.flight_log import FlightLog
from np_drake.payload_filter.training import flight_samples, torque_steps, train_payload_filter
from np_drake.residual_model import Sample
from np_drake.rotor_input import acting_command
from np_drake.training_data.actuator_timing import delayed
from np_drake.vehicle import Vehicle
from tests.np_drake.payload_filter.conftest import flown

STEP = 0.02  # [s]


def as_log(flight, vehicle) -> FlightLog:
    """The made-up flight as a log whose accelerations give its labels."""
    x, u, chi = flight.x, flight.u, np.array([sample.chi for sample in flight.samples])
    p, q, v, w = np.split(x, [3, 7, 10], axis=1)
    log = FlightLog(STEP * np.arange(len(x)), p, q, v, w, u, name="made")
    log.a = (chi[:, :3] + u[:, :1] * body_z(x)) / vehicle.mass - [0.0, 0.0, vehicle.gravity]
    log.al = (chi[:, 3:] + u[:, 1:]) @ np.linalg.inv(vehicle.J).T
    return log


def body_z(x):
    return attitude.body_z(x[:, 3:7])


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle().check()


def test_it_finds_thrust_error_drag_and_hook_of_the_vehicle(vehicle):
    flight = flown(seconds=30.0, radius=1.0, dither=0.08, thrust_error=-0.04, drag=0.15, noise=0.05)
    model = train_payload_filter([(as_log(flight, vehicle), vehicle)], step=STEP)
    # three tenths of the payload's weight [1]
    assert model.thrust_error == pytest.approx(-0.04, abs=0.01)
    assert model.drag == pytest.approx(0.15, abs=0.02)  # [1/s]
    # noise of the torque label [m]
    np.testing.assert_allclose(model.hook, [0.0, 0.0, -0.025], atol=0.004)
    assert model.mass == vehicle.mass
    assert model.summary["origin"]["mass"] == vehicle.mass
    assert model.delay == 0.0  # the commands act at once


def test_torque_of_the_speed_is_not_taken_for_the_hooks(vehicle):
    flight = flown(seconds=30.0, radius=1.0, dither=0.08, noise=0.05)
    speed_torque = np.array([0.012, -0.016])  # [N·s]
    for sample in flight.samples:
        v = attitude.rotate_back(sample.x[3:7], sample.x[7:10])
        sample.chi[3:5] += speed_torque * v[[1, 0]]
    model = train_payload_filter([(as_log(flight, vehicle), vehicle)], step=STEP)
    # noise of the torque label [N·s]
    np.testing.assert_allclose(model.speed_torque, speed_torque, atol=0.001)
    np.testing.assert_allclose(model.hook, [0.0, 0.0, -0.025], atol=0.004)  # the same [m]


def test_samples_of_a_flight_pair_a_label_with_the_command_before_it(vehicle):
    log = as_log(flown(seconds=4.0), vehicle)
    log.u = log.u + np.arange(len(log))[:, None] * [0.01, 0, 0, 0]
    samples = flight_samples(log, vehicle, 0.0, STEP)
    assert len(samples) == len(log)
    np.testing.assert_allclose([s.u for s in samples[1:]], log.u[:-1])


def test_it_finds_the_delay_of_the_commands(vehicle):
    draw = np.random.default_rng(0)
    log = as_log(flown(seconds=20.0, radius=1.0, dither=0.08), vehicle)
    smooth, lagged = log.u, dc.replace(vehicle, rotor_time_constant=0.03)
    log.u = smooth + draw.normal(size=log.u.shape) * [1.0, 0.1, 0.1, 0.02]
    late = acting_command(delayed(log, 3 * STEP), lagged) - smooth
    log.a += late[:, :1] * body_z(log.x) / vehicle.mass
    log.al += late[:, 1:] @ np.linalg.inv(vehicle.J).T
    model = train_payload_filter([(log, vehicle)], step=STEP)
    assert model.delay == pytest.approx(3 * STEP)
    assert model.rotor_lag == pytest.approx(0.03, abs=0.003)


def test_flights_of_two_vehicles_or_without_torque_are_refused(vehicle):
    log = as_log(flown(seconds=4.0), vehicle)
    without = dc.replace(log, al=np.full((len(log), 3), np.nan), name="blind")
    other = dc.replace(vehicle, mass=3.0)
    for flights, match in (
        ([(log, vehicle), (log, other)], "one vehicle"),
        ([(log, vehicle), (without, vehicle)], "flight blind must have torque labels"),
    ):
        with pytest.raises(ValueError, match=match):
            train_payload_filter(flights, step=STEP)


def test_the_torque_across_a_gap_is_no_step():
    torque = np.array([1.0, 1.1, np.nan, 5.0, 4.0, np.nan])  # [N·m]
    samples = [Sample(np.zeros(13), np.zeros(4), np.full(6, value)) for value in torque]
    np.testing.assert_allclose(torque_steps(samples), [[0.1] * 3, [-1.0] * 3])
    assert torque_steps(samples[1:4]).shape == (0, 3)
    assert torque_steps([]).shape == (0, 3)
