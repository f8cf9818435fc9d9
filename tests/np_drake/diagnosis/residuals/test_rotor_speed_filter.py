"""Laws of thrust from measured rotor speed."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.decision.unexplained import slow_torque
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import low_pass, make_flight_residuals
from np_drake.diagnosis.residuals.rotor_thrust import _read_thrust
from np_drake.effects.linear_drag import LinearDrag
from np_drake.flight_log import FlightLog
from np_drake.rotor_input import rotor_speed, rotor_wrench
from np_drake.vehicle import Vehicle

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)

VEHICLE = Vehicle()
NOISE = 4.0  # of readings of rotor speed [rad/s]


def known(log: FlightLog) -> FlightLog:
    """Return the log with rotor speed at its rows in place of a held command, taken in the middle
    of its step.
    """
    at_rows = np.concatenate([log.u[:1], 0.5 * (log.u[1:] + log.u[:-1])])
    return dc.replace(log, u=at_rows, input="rotor_speed")


def read(log: FlightLog, noise: float = NOISE, seed: int = 0) -> FlightLog:
    """Return the log with noise on its rotor speed [rad/s]."""
    spin = rotor_speed(VEHICLE, known(log).u)
    spin = spin + noise * np.random.default_rng(seed).normal(size=spin.shape)
    return dc.replace(known(log), u=rotor_wrench(VEHICLE, spin))


def wrench_noise(log: FlightLog) -> np.ndarray:
    """Return the mean deviation of thrust and torques (4,) due to the noise of the readings [N,
    N·m].
    """
    of_rotors = (
        2 * VEHICLE.thrust_coefficient * NOISE * np.mean(rotor_speed(VEHICLE, log.u), axis=0)
    )
    return np.sqrt(VEHICLE.mixer**2 @ of_rotors**2)


def as_log(u: np.ndarray) -> FlightLog:
    """Return a log at rest at 100 Hz whose rotors gave u (n, 4) [N, N·m]."""
    zeros, q = np.zeros((len(u), 3)), np.tile([1.0, 0.0, 0.0, 0.0], (len(u), 1))
    return FlightLog(0.01 * np.arange(len(u)), zeros, q, zeros, zeros, u, input="rotor_speed")


def test_a_collective_motion_lets_no_noise_into_torque():
    """All rotors share the spectrum of thrust; filtered one by one, their noise in its bands would
    pass as torque.
    """
    rng, n = np.random.default_rng(0), 4000
    thrust = 4.0 * low_pass(rng.normal(size=(n, 1)), 0.01, 15.0)
    rotors = 4.0 + thrust + 0.3 * rng.normal(size=(n, 4))
    log = as_log(rotors @ VEHICLE.mixer.T)
    found, noise = _read_thrust(log, VEHICLE)
    left = (found @ VEHICLE.mixer.T)[:, 1:].var(axis=0) / noise[1:] ** 2
    assert (
        left.max() < 0.05
    )  # of the noise that was read; the share of the bands with thrust is about a third
    known = (found @ VEHICLE.mixer.T)[:, 0]
    assert np.std(known - 4 * (4.0 + thrust[:, 0])) < 0.7 * noise[0]


def test_rows_put_into_gaps_do_not_lower_the_noise():
    rng, n = np.random.default_rng(0), 4000
    log = as_log(4.0 + rng.normal(size=(n, 4)))
    whole = _read_thrust(log, VEHICLE)[1]
    lost = np.zeros(n, bool)
    for start in range(20, n - 20, 20):
        lost[start : start + 8] = True
    rows = np.arange(n)
    filled = np.stack([np.interp(rows, rows[~lost], c[~lost]) for c in log.u.T], axis=1)
    noise = _read_thrust(dc.replace(log, u=filled, bridged=lost), VEHICLE)[1]
    np.testing.assert_allclose(noise, whole, rtol=0.1)  # of a median of 1600 differences


def test_likeliest_thrust_is_nearer_than_the_reading_and_its_noise_known(fly):
    log = fly(noise=1.0, seconds=20.0)
    true, seen = (x.u @ VEHICLE.unmixer.T for x in (known(log), read(log)))
    found, noise = _read_thrust(read(log), VEHICLE)
    np.testing.assert_allclose(noise, wrench_noise(log), rtol=0.1)
    assert np.std(found - true) < 0.5 * np.std(seen - true)


def test_how_the_most_likely_thrust_errs_does_not_go_with_what_it_is(fly):
    """What was read does: there lies the share of noise that a regression takes for an answer."""
    log = fly(noise=1.0, seconds=20.0, vigour=0.2)
    true, seen = (x.u @ VEHICLE.unmixer.T for x in (known(log), read(log)))
    found, _ = _read_thrust(read(log), VEHICLE)
    slopes = [
        np.sum((x - true) * (x - x.mean(axis=0))) / np.sum((x - x.mean(axis=0)) ** 2)
        for x in (found, seen)
    ]
    assert abs(slopes[0]) < 0.3 * slopes[1]


def test_thrust_that_jitters_is_no_noise_where_the_motion_answers_to_it(fly):
    log = fly(seconds=10.0)
    jitter = np.zeros_like(log.u)
    jitter[:, 1] = 0.05 * np.random.default_rng(0).normal(size=len(log.t))
    turned = np.zeros_like(log.w)
    turned[1:, 0] = (
        np.cumsum(0.5 * (jitter[1:, 1] + jitter[:-1, 1]) * np.diff(log.t)) / VEHICLE.J[0, 0]
    )
    shaken = dc.replace(log, u=log.u + jitter, input="rotor_speed")
    found, noise = _read_thrust(dc.replace(shaken, w=log.w + turned), VEHICLE)
    np.testing.assert_array_equal(found, shaken.u @ VEHICLE.unmixer.T)
    np.testing.assert_array_equal(noise, 0.0)
    _, noise = _read_thrust(shaken, VEHICLE)  # nothing turns
    assert noise.min() > 0.0


def test_the_channels_know_how_well_thrust_was_read(fly):
    log = fly(seconds=20.0, vigour=0.0)
    dut = make_flight_residuals(read(log), VEHICLE)
    per_grid = wrench_noise(log) * np.sqrt(log.step / dut.grid.step)
    np.testing.assert_allclose(dut.rotor_noise[2:6], per_grid, rtol=0.1)
    np.testing.assert_array_equal(dut.rotor_noise[[0, 1, *range(6, 15)]], 0.0)
    np.testing.assert_array_equal(make_flight_residuals(log, VEHICLE).rotor_noise, 0.0)


def test_torque_that_was_read_with_noise_is_no_torque_that_comes_and_goes(fly):
    flights = [
        make_flight_residuals(read(fly(noise=1.0, seed=i, name=str(i)), seed=i), VEHICLE)
        for i in range(2)
    ]
    ratio, *_ = slow_torque(flights, {e.name: e.y for e in flights})
    assert ratio < REAL.thresholds.slow_torque_ratio
    deaf = [dc.replace(e, log=dc.replace(e.log, input="command")) for e in flights]
    assert slow_torque(deaf, {e.name: e.y for e in flights})[0] > 2 * ratio


@pytest.mark.parametrize("effects", [(), (LinearDrag(0.3, 0.3, 0.3),)])
def test_noisy_readings_of_rotor_speed_are_no_cause_and_hide_none(fly, inferred, effects):
    flights = [
        make_flight_residuals(
            read(fly(*effects, noise=1.0, seed=i, name=str(i), seconds=8.0), seed=i), VEHICLE
        )
        for i in range(3)
    ]
    found = inferred(flights[:2], flights[2:])
    assert [c.identifier for c in found.causes] == [e.identifier for e in effects]
    assert not found.unknown
