"""Laws of the firmware as a system between controller and rotors."""

import dataclasses as dc

import pytest

from diagrams.evidence import coverage
from diagrams.loop.flight import FlightConfig, default_flight
from diagrams.loop.flight_result import fly
from np_drake.files.yaml_file import filled
from np_drake.identification.rate_loop import identify_rate_loop
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop

VEHICLE = dc.replace(Vehicle(), rate_loop=RateLoop())


@pytest.fixture(scope="module")
def flown(firmware):
    def one(kind):
        config = dc.replace(default_flight(VEHICLE), duration=18.0).with_autopilot("betaflight")
        config.controller.kind = kind
        return fly(config.check_and_step(), seed=1)

    return {kind: one(kind) for kind in ("nominal", "payload_filter")}


def test_the_vehicle_flies_on_the_firmware_and_a_forecast_flies_best(flown):
    errors = {kind: one.metrics()["E_xy"] for kind, one in flown.items()}
    assert errors["payload_filter"] < 0.4 * errors["nominal"] < 0.04


def test_its_rate_loop_is_that_of_the_gains_it_was_given(flown):
    roll, pitch, _ = identify_rate_loop([flown["nominal"].log()])
    for loop in (roll, pitch):
        # behind the bandwidth of 20 rad/s: rotors, filters and link
        assert 1 / 20.0 < loop.lag < 0.1
        assert loop.gain == pytest.approx(1.05, abs=0.1)


def test_the_study_certifies_the_rate_loop_and_flies_the_firmware(firmware, monkeypatch):
    monkeypatch.setattr(coverage, "LOGGED", 6.0)
    found = coverage.known_by_firmware({"seed": 0})
    corrected, true = (filled(FlightConfig(), found[name]) for name in ("corrected", "true"))
    assert (corrected.autopilot.kind, true.autopilot.kind) == ("rate_loop", "betaflight")
    assert "rate_loop.lag" in corrected.vehicle.intervals
    assert true.controller.vehicle.rate_loop == corrected.vehicle.rate_loop
    assert fly(dc.replace(corrected, duration=0.5), seed=0).metrics()["E_xy"] < 0.05  # [m]
