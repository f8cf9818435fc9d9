"""Laws of the simulated flights over the envelope of a vehicle."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagrams.batch.arrays import packed, unpacked
from diagrams.prediction.envelope import (
    LENGTH,
    MASS,
    SPEED,
    Envelope,
    envelope_flight,
    envelope_segments,
)
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import similar


def test_flights_lie_within_the_envelope():
    for number in range(40):
        config = envelope_flight(number, seed=3, vehicle=Vehicle())
        hung = config.reality.payload
        assert hung.tether == "none" or (
            MASS[0] <= hung.mass <= MASS[1] and LENGTH[0] <= hung.length <= LENGTH[1]
        )
        assert SPEED[0] <= config.reference.speed <= SPEED[1]


def test_a_flight_is_drawn_from_seed_and_number_alone():
    first, again, other = (
        envelope_flight(number, seed=3, vehicle=Vehicle()).reality.payload.mass
        for number in (5, 5, 6)
    )
    assert first == again != other


def test_a_larger_vehicle_flies_a_larger_envelope():
    small, large = (
        envelope_flight(2, seed=3, vehicle=v) for v in (Vehicle(), similar(Vehicle(), 4.0))
    )
    assert large.reality.payload.length == pytest.approx(4 * small.reality.payload.length)
    assert large.duration == pytest.approx(2 * small.duration)


def test_a_lost_vehicle_teaches_nothing():
    arrays = {name: np.ones((4, 6)) for name in ("chi", "zeta", "goal")}
    records = [{"result": {"segment": packed(arrays)}}, {"error": "lost at 3 s"}]
    run = SimpleNamespace(seed=3, cases=lambda *_, **__: records)
    segments = envelope_segments(2, run=run, vehicle=Vehicle())
    assert [len(segment) for segment in segments] == [4]


def test_what_is_learnt_is_what_a_vehicle_measures():
    result = Envelope(3, Vehicle())({"flight": 2})
    arrays = unpacked(result["segment"])
    config = envelope_flight(2, seed=3, vehicle=Vehicle())
    weight = config.reality.payload.mass * 9.81
    drift = (config.reality.thrust_scale - 1.0) * (Vehicle().mass * 9.81 + weight)
    assert arrays["goal"][200:, 2].mean() == pytest.approx(-weight + drift, abs=0.15 * weight + 0.3)
    assert set(arrays) == {"chi", "zeta", "goal"}
