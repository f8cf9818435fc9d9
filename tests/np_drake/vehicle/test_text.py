"""Laws of the vehicle file that is written from a vehicle."""

import dataclasses as dc

import pytest

from np_drake.vehicle.text import save_vehicle, vehicle_text
from np_drake.vehicle.vehicle import (
    Calibration,
    RateLoop,
    ThrottleMap,
    Vehicle,
    load_vehicle,
    preset_names,
)

MAP = ThrottleMap(full_thrust=6.0, linear=0.3)
KNOWN = dc.replace(
    Vehicle(),
    mass=1.5,
    throttle=MAP,
    calibration=Calibration(command_delay=0.012),
    rate_loop=RateLoop(),
    sources={
        "mass": "given",
        "thrust_coefficient": "identified from 3 flights",
        "calibration.command_delay": "prior: hover alone does not tell it",
    },
    intervals={
        "thrust_coefficient": [[9.9e-6, 1.01e-5]],
        "calibration.center_of_mass": [[-1e-3, 1e-3]] * 3,
    },
).check()


@pytest.fixture(scope="module")
def again(tmp_path_factory):
    """The vehicle that is read from the file of another."""
    file = tmp_path_factory.mktemp("text") / "vehicle.yaml"

    def read(vehicle):
        save_vehicle(vehicle, file)
        return load_vehicle(file)

    return read


def same(a, b):
    return a == b and (a.sources, a.intervals) == (b.sources, b.intervals)


def test_a_vehicle_is_read_as_it_was_written(again):
    for vehicle in (KNOWN, *map(load_vehicle, preset_names())):
        assert same(again(vehicle), vehicle)


def test_every_number_has_unit_source_and_interval_beside_it():
    lines = vehicle_text(KNOWN).splitlines()
    assert "mass: 1.5 # [kg] given" in lines
    assert (
        "thrust_coefficient: 1.0e-05 # [N/(rad/s)²] identified from 3 flights, 95 %: "
        "9.9e-06 … 1.01e-05"
    ) in lines
    assert "  command_delay: 0.012 # [s] prior: hover alone does not tell it" in lines
    assert all(len(line) <= 120 for line in lines if "]]" not in line)


def test_an_impossible_vehicle_is_not_written(tmp_path):
    with pytest.raises(ValueError, match="mass must be positive"):
        save_vehicle(dc.replace(Vehicle(), mass=-1.0), tmp_path / "bad.yaml")
    assert not (tmp_path / "bad.yaml").exists()
