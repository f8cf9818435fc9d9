"""Laws of the study of controllers on the firmware."""

import numpy as np
import pytest

from diagrams.gap import autopilot_study as study
from diagrams.gap.autopilot_study import CORRECTED, FIRMWARE, NOMINAL, Flying, flight
from diagrams.gap.step_response import SIZES, step_response
from np_drake.autopilot.betaflight import AutopilotError, find_firmware
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop


@pytest.fixture(scope="module")
def firmware():
    try:
        find_firmware()
    except AutopilotError as missing:
        pytest.skip(f"{missing} `make autopilot` runs these tests.")


@pytest.mark.parametrize("axis", [0, 2])
@pytest.mark.usefixtures("firmware")
def test_a_step_of_a_rate_is_followed_to_its_size(axis):
    response = step_response(Vehicle(), axis)
    assert response.t[0] == 0.0
    assert abs(response.rate[0]) < 0.02 / SIZES[axis]
    assert response.gain == pytest.approx(1.0, abs=0.1)
    assert response.gain <= response.largest < 1.3
    assert 0.03 < response.lag < 0.3


def test_simulators_fly_the_loop_in_the_firmwares_place():
    loop = RateLoop([0.06, 0.06, 0.2])
    for where, kind in ((FIRMWARE, "betaflight"), (NOMINAL, "rate_loop"), (CORRECTED, "rate_loop")):
        config = flight("circle", "hold", where, loop=loop, duration=10.0)
        assert (config.autopilot.kind, config.vehicle.rate_loop) == (kind, loop)


def test_in_the_nominal_simulator_nothing_acts_beyond_the_file():
    loop = RateLoop()
    own = flight("circle", "nominal", NOMINAL, loop=loop, duration=10.0)
    work = Flying(loop, {NOMINAL: own.reality.nominal()}, 10.0)
    told = {"experiment": "circle", "row": "nominal", "seed": 1}
    loaded, bare = (
        Flying(loop, {}, 10.0)(told | {"where": NOMINAL}),
        work(told | {"where": NOMINAL}),
    )
    assert bare["E_z"] < 0.1 * loaded["E_z"]


def test_a_line_is_the_mean_over_its_seeds_and_over_nominal():
    same = {"where": FIRMWARE, "experiment": "circle", "E_z": 1.0, "solve_failures": 1}
    flown = [
        same | {"row": row, "seed": seed, "E_xy": value * seed}
        for row, value in (("nominal", 2.0), ("np", 0.5))
        for seed in (1, 3)
    ]
    nominal, np_line = study._lines(flown)
    assert (nominal["E_xy"], np_line["E_xy"]) == (4.0, 1.0)
    assert np_line["over_nominal"] == 0.25
    assert np_line["solve_failures"] == 2
    assert np.isfinite(np_line["E_xy_ci95"])
