"""Laws of flights that are drawn over the envelope of a vehicle."""

import contextlib

import pytest

from diagrams.loop.experiments import settings_of
from diagrams.random_flights import (
    BEYOND,
    HANGING,
    LENGTH,
    MASS,
    PLAIN,
    RADIUS,
    RAMP,
    SPEED,
    THRUST,
    Envelope,
    drawn_flight,
)
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.scaling import ratios

ALL, SMALL = Envelope((PLAIN, *BEYOND), 0.5), load_vehicle("crazyflie")


def flights(vehicle=None, envelope=ALL):
    """By number, (kind, flight) of those that the vehicle can fly, which most are."""
    found = {}
    for number in range(60):
        with contextlib.suppress(ValueError):
            found[number] = drawn_flight(number, envelope, seed=3, vehicle=vehicle or Vehicle())
    assert len(found) > 50
    return found


@pytest.fixture(scope="module")
def drawn():
    return flights()


def test_a_number_is_one_flight_and_another_seed_another(drawn):
    kind, again = drawn_flight(7, ALL, seed=3, vehicle=Vehicle())
    _, other = drawn_flight(7, ALL, seed=4, vehicle=Vehicle())
    assert kind == drawn[7][0]
    assert settings_of(again) == settings_of(drawn[7][1]) != settings_of(other)


def test_every_kind_is_drawn_and_within_its_ranges(drawn):
    assert {kind for kind, _ in drawn.values()} == {PLAIN, *BEYOND}
    for kind, config in drawn.values():
        hung, reference = config.reality.payload, config.reference
        lightest = 0.7 * MASS[0] if kind == "two payloads" else MASS[0]
        assert lightest <= hung.mass <= MASS[1]
        within = [(hung.length, LENGTH), (config.reality.thrust_scale, THRUST)]
        if reference.track != "hover":
            within += [(reference.speed, SPEED), (reference.ramp, RAMP)]
        if reference.track == "circle":
            within.append((reference.radius, RADIUS))
        assert all(low <= value <= high for value, (low, high) in within)
        assert bool(hung.rope_mass) == (kind in ("rope", "two payloads"))
        assert bool(config.reality.effects) == (kind == "displaced mass")


def test_what_happens_happens_to_a_payload_and_within_the_flight(drawn):
    kinds = [event.kind for _, config in drawn.values() for event in config.events]
    assert set(kinds) == {"attach", "release"}
    assert 15 < len(kinds) < 45
    for kind, config in drawn.values():
        if config.events or kind in HANGING:
            assert config.reality.payload.tether != "none"
        for event in config.events:
            assert config.reference.ramp < event.time < config.end - 2.5  # the response is seen [s]
    assert all(config.events for _, config in flights(envelope=Envelope((PLAIN,), 1.0)).values())


def test_flights_of_a_small_vehicle_are_as_much_smaller(drawn):
    unit, small = ratios(SMALL), flights(SMALL)
    for number in drawn.keys() & small.keys():
        (kind, config), (own_kind, own) = drawn[number], small[number]
        assert own_kind == kind
        track, hung = config.reference, config.reality.payload
        expected = [unit.length * track.radius, unit.length * hung.length]
        speed = unit.length / unit.time * track.speed
        found = [own.reference.radius, own.reality.payload.length, own.reference.speed]
        assert found == pytest.approx([*expected, speed])
        for effect, smaller in zip(config.reality.effects, own.reality.effects, strict=True):
            scaled = {name: unit.length * value for name, value in effect.parameters.items()}
            assert smaller.parameters == pytest.approx(scaled)
