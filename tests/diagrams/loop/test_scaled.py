"""Scenarios for any vehicle: the paper's keeps its values, and similar vehicles fly alike."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.loop.experiments import load_experiment, settings_of
from diagrams.loop.flight import FlightConfig, default_flight
from diagrams.loop.flight_result import fly
from np_drake.command_delay import LONGEST_DELAY
from np_drake.references.config import make_reference
from np_drake.vehicle.scaling import ratios, scales
from np_drake.vehicle.vehicle import Calibration, MeasurementNoise, Vehicle, load_vehicle
from tests.similar import similar

SMALL, LARGE = similar(Vehicle(), 0.26), similar(Vehicle(), 2.3)
SMALL = dc.replace(SMALL, name="small", max_rotor_thrust=1.2 * SMALL.max_rotor_thrust)
LARGE = dc.replace(LARGE, name="large", mass=0.9 * LARGE.mass)


def plain(config: FlightConfig) -> dict:
    return settings_of(config) | {"scaled": False}


def test_the_default_scenario_of_the_papers_vehicle_is_bit_identical():
    assert plain(default_flight(Vehicle())) == plain(FlightConfig())


@pytest.mark.parametrize("vehicle", [SMALL, LARGE])
@pytest.mark.parametrize("name", ["fast_lemniscate", "steps"])
def test_a_track_has_the_same_form_in_the_units_of_any_vehicle(name, vehicle):
    paper, own = load_experiment(name).reference, load_experiment(name, vehicle).reference
    unit, t = ratios(vehicle), np.linspace(0.0, 20.0, 101)
    expected = make_reference(paper).sample(t)
    found = make_reference(own).sample(unit.time * t)
    np.testing.assert_allclose(found[0] / unit.length, expected[0], atol=1e-9)
    # accelerations: gravity is common [m/s²]
    np.testing.assert_allclose(found[2], expected[2], atol=1e-7)


def test_the_controller_knows_the_delay_of_the_file_within_its_limit():
    for delay in (0.004, 0.5):
        known = Calibration(command_delay=delay)
        vehicle = dc.replace(load_vehicle("crazyflie"), calibration=known)
        dut = default_flight(vehicle).check().controller
        assert dut.command_delay == pytest.approx(min(delay, LONGEST_DELAY * dut.period))


def test_similar_vehicles_fly_the_same_dimensionless_circle():
    errors = []
    for vehicle in (Vehicle(), similar(Vehicle(), 0.25)):
        config = load_experiment("circle", vehicle)
        config.reality.noise = MeasurementNoise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        config.duration, config.reference.ramp = (s * ratios(vehicle).time for s in (0.5, 1.0))
        config.controller.kind, config.controller.solver = "hold", "sqp"
        flight, unit = fly(config, seed=0), scales(vehicle)
        errors.append((flight.signals["x_true"][:, :3] - flight.signals["p_ref"]) / unit.length)
    # [1]: the feed-forward's step in time is fixed
    np.testing.assert_allclose(errors[1], errors[0], rtol=0, atol=1e-6)
