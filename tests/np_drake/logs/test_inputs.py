"""Laws of inputs: one throttle map of a vehicle, and a thrust coefficient that is a guess."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.flight_log import FlightLog
from np_drake.logs.inputs import (
    hover_exponent,
    with_hover_thrust,
    with_throttle_input,
    with_throttle_map,
)
from np_drake.rotor_input import with_rotor_input
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import THROTTLE_POWER, VOLTAGE, ThrottleMap

VEHICLE = Vehicle()
WEIGHT = VEHICLE.mass * VEHICLE.gravity
EXPONENT = 1.7


def bobbing(amplitude: float, hover: float, seed: int, exponent: float = EXPONENT) -> FlightLog:
    """Return a level flight whose thrust varies by a share `amplitude` of the weight, with a
    collective throttle.

    Velocities have 0.05 m/s of noise.
    """
    rng, t = np.random.default_rng(seed), 0.01 * np.arange(2000)
    swing = amplitude * np.sin(2 * np.pi * 0.5 * t)
    v = np.zeros((len(t), 3))
    v[1:, 2] = 0.01 * VEHICLE.gravity * np.cumsum(swing[:-1])
    zeros, q = np.zeros((len(t), 3)), np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))
    throttle = hover * (1 + swing[:, None]) ** (1 / exponent)
    u, read = np.full((len(t), 4), np.nan), v + 0.05 * rng.normal(size=v.shape)
    return with_throttle_input(FlightLog(t, zeros, q, read, zeros, u, throttle=throttle), VEHICLE)


def hover_of(log: FlightLog) -> float:
    """Return the throttle that carries the vehicle's weight."""
    assert log.throttle is not None
    return float(np.interp(WEIGHT, *np.sort([log.u[:, 0], log.throttle[:, 0]], axis=1)))


def exponent_of(log: FlightLog) -> float:
    """Return the slope of the logarithm of thrust over that of throttle."""
    assert log.throttle is not None
    return float(np.polyfit(np.log(log.throttle[:, 0]), np.log(log.u[:, 0]), 1)[0])


def test_the_exponent_of_a_lively_flight_is_found():
    assert exponent_of(bobbing(0.4, 0.5, 0)) == pytest.approx(EXPONENT, rel=0.02)  # of the noise


def test_one_vehicle_has_one_map_which_carries_its_weight_in_training():
    flights = [bobbing(0.2, hover, seed) for seed, hover in enumerate((0.5, 0.55))]
    train, (held_out,) = with_throttle_map(VEHICLE, flights, [bobbing(0.2, 0.6, 2)])
    found = [exponent_of(log) for log in [*train, held_out]]
    np.testing.assert_allclose(found, found[0], rtol=1e-9)
    hovers = [hover_of(log) for log in [*train, held_out]]
    np.testing.assert_allclose(hovers, hovers[0], rtol=0.01)  # of the interpolation
    assert hovers[0] == pytest.approx(0.525, rel=0.01)  # the middle of the training flights


def test_flights_before_a_change_tell_the_exponent_and_how_thrust_scatters():
    before = [bobbing(0.4, hover, seed, 2.0) for seed, hover in enumerate((0.5, 0.5))]
    (log, _), _ = with_throttle_map(VEHICLE, before, [bobbing(0.4, 0.45, 2, 2.0)], before=True)
    assert log.throttle_map.exponent == pytest.approx(2.0, rel=0.02)  # of the noise
    assert (log.throttle_map.freedom, log.throttle_map.scatter < 1e-4) == (1, True)
    twice = [before[0], dc.replace(before[1], throttle=1.05 * before[1].throttle)]
    (log, _), _ = with_throttle_map(VEHICLE, twice, [], before=True)
    assert log.throttle_map.scatter == pytest.approx(0.5 * (2 * np.log(1.05)) ** 2, rel=0.1)


def test_a_battery_that_falls_is_the_voltage_and_no_other_map():
    full, empty = (
        dc.replace(bobbing(0.2, 0.5, 0), voltage=np.full(2000, volts)) for volts in (16.0, 14.4)
    )
    assert empty.throttle is not None
    empty = dc.replace(empty, throttle=empty.throttle * (16.0 / 14.4) ** (VOLTAGE / THROTTLE_POWER))
    (first,), (second,) = with_throttle_map(VEHICLE, [full], [empty])
    np.testing.assert_allclose(second.u[:, 0], first.u[:, 0], rtol=1e-12)


def test_the_map_of_the_vehicle_file_is_taken_as_it_is():
    known = ThrottleMap(full_thrust=10.0, linear=0.3)
    vehicle = dc.replace(VEHICLE, throttle=known)
    (log,), _ = with_throttle_map(vehicle, [bobbing(0.2, 0.7, 0)], [])
    assert log.throttle is not None
    np.testing.assert_allclose(log.u[:, 0], 4 * known.thrust(log.throttle[:, 0]), rtol=1e-12)
    assert log.notes == ["thrust from throttle by the vehicle file's map"]


def test_the_exponent_at_hover_is_that_of_the_map():
    assert hover_exponent(VEHICLE) == THROTTLE_POWER
    for linear, exponent in ((0.0, 2.0), (1.0, 1.0)):
        vehicle = dc.replace(VEHICLE, throttle=ThrottleMap(full_thrust=10.0, linear=linear))
        assert hover_exponent(vehicle) == pytest.approx(exponent, rel=1e-6)


TRUE = Vehicle(input="rotor_speed")


def hovering(vehicle: Vehicle, name: str = "made", above: float = 0.0) -> FlightLog:
    """Return a hover with rotor speed; above: share of the weight that the rotors carry beside
    it.
    """
    t = np.arange(0.0, 5.0, 0.02)
    thrust = 0.25 * TRUE.mass * TRUE.gravity * (1 + above) * (1 + 0.01 * np.sin(9 * t))
    rotor = np.repeat(np.sqrt(thrust / TRUE.thrust_coefficient)[:, None], 4, axis=1)
    still = np.zeros((len(t), 3))
    q = np.column_stack([np.ones(len(t)), still])
    log = FlightLog(t, still, q, still, still, np.full((len(t), 4), np.nan), rotor=rotor, name=name)
    return with_rotor_input(log, vehicle)


def guessed(factor: float) -> Vehicle:
    """Return the vehicle with coefficients that are off by a factor, and how well they are
    known.
    """
    k, c = factor * TRUE.thrust_coefficient, factor * TRUE.torque_coefficient
    return dc.replace(TRUE, thrust_coefficient=k, torque_coefficient=c, thrust_uncertainty=0.2)


def test_a_guess_gives_way_to_the_speed_that_carries_the_vehicle():
    file = guessed(1.4)
    dut, train, held_out = with_hover_thrust(
        file, [hovering(file)], [hovering(file, "other", above=0.1)]
    )
    assert dut.thrust_coefficient == pytest.approx(TRUE.thrust_coefficient, rel=1e-3)
    assert dut.torque_coefficient / dut.thrust_coefficient == pytest.approx(0.016)
    weight = TRUE.mass * TRUE.gravity
    assert np.mean(train[0].u[:, 0]) == pytest.approx(weight, rel=1e-3)
    assert np.mean(held_out[0].u[:, 0]) == pytest.approx(
        1.1 * weight, rel=1e-3
    )  # by the training flights' coefficient
    assert all(
        "with which rotor speed carries 2 kg" in log.notes[-1] for log in (train[0], held_out[0])
    )


def test_a_coefficient_beyond_its_uncertainty_is_of_another_vehicle():
    file = guessed(1 / 2.2)
    _, (dut,), _ = with_hover_thrust(file, [hovering(file)])
    assert dut.notes[-1].startswith(
        "thrust coefficient of another vehicle: rotor speed carries 2 kg with 2.2 times that of "
        "'paper'"
    )
