"""Laws of thrust from measured rotor speed."""

import dataclasses as dc

import numpy as np

from np_drake.diagnosis.residuals.rotor_thrust import _read_thrust
from np_drake.flight_log import FlightLog
from np_drake.rotor_input import rotor_speed, rotor_wrench
from np_drake.vehicle import Vehicle

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


def test_likeliest_thrust_is_nearer_than_the_reading_and_its_noise_known(fly):
    log = fly(noise=1.0, seconds=20.0)
    true, seen = (x.u @ VEHICLE.unmixer.T for x in (known(log), read(log)))
    found, noise = _read_thrust(read(log), VEHICLE)
    np.testing.assert_allclose(noise, wrench_noise(log), rtol=0.1)
    assert np.std(found - true) < 0.5 * np.std(seen - true)
