"""Laws of a vehicle's scales."""

import dataclasses as dc
import math

import numpy as np
import pytest

from np_drake.vehicle.scaling import numbers, payload_ratio, ratios, sampling_period, scales
from np_drake.vehicle.vehicle import Vehicle, load_vehicle, preset_names
from tests.similar import similar


def test_the_papers_vehicle_is_its_own_unit():
    unit = ratios(Vehicle())
    assert (unit.length, unit.mass, unit.time, unit.clock) == (1.0, 1.0, 1.0, 1.0)
    assert (unit.force, unit.torque) == (1.0, 1.0)
    assert payload_ratio(Vehicle(), 0.26) == 1.0


def test_length_is_the_arm_and_force_the_weight():
    unit = scales(Vehicle())
    assert unit.length == pytest.approx(0.127 * math.sqrt(2))
    assert unit.force == pytest.approx(2.0 * 9.81)
    assert unit.torque == pytest.approx(2.0 * 9.81 * unit.length)


@pytest.mark.parametrize("length", [0.2, 0.7, 5.0])
def test_similar_vehicles_have_the_same_dimensionless_numbers(length):
    expected, found = numbers(Vehicle()), numbers(similar(Vehicle(), length))
    np.testing.assert_allclose(
        np.hstack(dc.astuple(found)), np.hstack(dc.astuple(expected)), rtol=1e-12
    )
    assert ratios(similar(Vehicle(), length)).time == pytest.approx(math.sqrt(length))


def test_weak_gravity_slows_the_clock():
    moon = dc.replace(Vehicle(), gravity=9.81 / 4)
    assert ratios(moon).time == pytest.approx(2.0)
    assert sampling_period(moon) == 0.04


def test_the_presets_hover_and_carry_their_payload():
    for name in preset_names():
        vehicle = load_vehicle(name)
        carried = vehicle.mass + 0.26 * payload_ratio(vehicle, 0.26)
        assert carried * vehicle.gravity < 0.9 * 0.96 * 4 * vehicle.max_rotor_thrust, name
