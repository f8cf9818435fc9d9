"""Laws of thrust from throttle: the exponent is the vehicle's, the hover throttle the flight's."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.logs.throttle_input import with_one_exponent, with_throttle_input
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
WEIGHT = VEHICLE.mass * VEHICLE.gravity
EXPONENT = 1.7


def bobbing(amplitude: float, hover: float, seed: int, exponent: float = EXPONENT) -> FlightLog:
    """Return a level flight whose thrust varies by a share `amplitude` of the weight, with a collective throttle.

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


def exponent_of(log: FlightLog) -> float:
    """Return the slope of the logarithm of thrust over that of throttle."""
    assert log.throttle is not None
    return float(np.polyfit(np.log(log.throttle[:, 0]), np.log(log.u[:, 0]), 1)[0])


def test_the_exponent_of_a_lively_flight_is_found():
    assert exponent_of(bobbing(0.4, 0.5, 0)) == pytest.approx(EXPONENT, rel=0.02)  # of the noise


def test_one_vehicle_has_one_exponent_and_each_flight_a_hover_throttle():
    train, held_out = with_one_exponent(
        VEHICLE, [bobbing(0.4, 0.5, 0), bobbing(0.03, 0.55, 1)], [bobbing(0.03, 0.6, 2)]
    )
    found = [exponent_of(log) for log in [*train, *held_out]]
    np.testing.assert_allclose(found, found[0], rtol=1e-9)
    assert found[0] == pytest.approx(EXPONENT, rel=0.02)  # of the noise
    for log, hover in zip([*train, *held_out], (0.5, 0.55, 0.6), strict=True):
        assert log.throttle is not None
        at_weight = np.interp(WEIGHT, *np.sort([log.u[:, 0], log.throttle[:, 0]], axis=1))
        assert at_weight == pytest.approx(hover, rel=0.01)  # of the noise


def test_a_held_out_flight_does_not_change_the_exponent():
    train = [bobbing(0.2, 0.5, 0)]
    (alone,), _ = with_one_exponent(VEHICLE, train, [])
    (beside,), (held_out,) = with_one_exponent(VEHICLE, train, [bobbing(0.4, 0.5, 1, exponent=1.2)])
    np.testing.assert_array_equal(alone.u, beside.u)
    assert exponent_of(held_out) == pytest.approx(exponent_of(alone), rel=1e-9)


def test_a_flight_alone_keeps_its_map_and_its_note():
    log = bobbing(0.3, 0.5, 0)
    (again,), _ = with_one_exponent(VEHICLE, [log], [])
    np.testing.assert_allclose(again.u, log.u, rtol=1e-12)
    assert [note.split(":")[0] for note in again.notes] == ["thrust from throttle"]


def test_flights_with_another_input_are_as_they_were():
    log = dc.replace(bobbing(0.3, 0.5, 0), input="command")
    (train,), (held_out,) = with_one_exponent(VEHICLE, [log], [log])
    assert train is log
    assert held_out is log


def test_a_log_without_throttle_is_refused():
    with pytest.raises(LogError, match="throttle"):
        with_throttle_input(dc.replace(bobbing(0.3, 0.5, 0), throttle=None), VEHICLE)
