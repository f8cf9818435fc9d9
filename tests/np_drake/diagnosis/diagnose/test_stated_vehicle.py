"""Laws of a vehicle file that states how well it is known, from the file to the verdict."""

import dataclasses as dc

import pytest

from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.options import Tolerance
from np_drake.effects import InertiaError
from np_drake.vehicle import Vehicle
from tests.np_drake.diagnosis.simulated_flights import fly

YAW = 0.63  # of the inertia about z that the file states [1]
COPIED = Vehicle(rotor_time_constant=0.0, command_timing="unknown")


def stated(vehicle):
    """Return the vehicle with stated uncertainties: inertia 5 %, thrust 2 %, centre 1 mm."""
    intervals = [
        [moment - 0.1 * abs(moment), moment + 0.1 * abs(moment)] for moment in vehicle.J.ravel()
    ]
    return dc.replace(
        vehicle,
        mass_uncertainty=0.005,
        thrust_uncertainty=0.02,
        intervals={"inertia": intervals, "calibration.center_of_mass": [[-0.002, 0.002]] * 3},
    ).check()


def flown(inertia, seed):
    """Return three flights of the vehicle with its moments of inertia scaled."""
    return [
        fly(
            InertiaError(*inertia),
            name=f"f{i}",
            seed=seed + i,
            seconds=14.0,
            noise=1.0,
            vehicle=COPIED,
        )
        for i in range(3)
    ]


@pytest.fixture(scope="module")
def flights():
    return flown((1.0, 1.0, YAW), 40)


def found(vehicle, flights):
    return diagnose(flights[:2], flights[2:], vehicle, tolerance=Tolerance(), adaptive_split=False)


def test_what_a_stated_interval_excludes_is_named_with_its_size(flights):
    dut = found(stated(COPIED), flights)
    assert dut.verdict == ("inertia_error",)
    (cause,) = dut.causes
    low, high = cause.parameters["scale_zz"].ci95
    assert low <= YAW <= high
    assert high - low < 0.1


def test_where_nothing_is_stated_the_same_error_is_calibration(flights):
    dut = found(COPIED, flights)
    assert dut.verdict == ()
    told = {difference.name: difference for difference in dut.calibration}
    low, high = told["inertia_error.scale_zz"].ci95
    assert low <= YAW - 1.0 <= high < 0.0


def test_what_lies_within_a_stated_interval_is_not_named():
    flights = flown((1.05, 0.96, 1.04), 50)
    assert "inertia_error" not in found(stated(COPIED), flights).verdict
