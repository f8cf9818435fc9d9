"""What a delay of commands costs that no training has shown."""

import pytest

from diagrams.loop.controllers import ControllerConfig
from diagrams.loop.flight import FlightConfig, LostVehicle, simulate
from diagrams.loop.flight_result import fly
from np_drake.references.config import ReferenceConfig


def late(delay, *, kind="np", speed=1.5, **controller):
    config = FlightConfig(duration=5.0)
    config.reference = ReferenceConfig(track="circle", radius=1.0, speed=speed, ramp=4.0)
    config.controller = ControllerConfig(kind=kind, solver="sqp", **controller)
    config.reality.command_delay = delay
    return config


@pytest.mark.parametrize("speed, delay, error", [(1.5, 0.06, 0.012), (1.5, 0.115, 0.02), (2.5, 0.03, 0.012)])
def test_np_finds_a_delay_in_flight_and_holds_the_circle(speed, delay, error):
    errors = fly(late(delay, speed=speed), seed=0).metrics()
    assert (
        errors["E_xy"] < error
    )  # a fifth of `nominal` without delay, 2.5 and 6.4 cm, with the first seconds [m]
    assert errors["solve_failures"] == 0
    assert errors["command_delay"] == pytest.approx(delay, abs=0.0051)  # a quarter period [s]


@pytest.mark.parametrize("kind", ["nominal", "hold"])
def test_a_controller_that_is_told_the_delay_or_finds_it_holds_what_others_lose(kind):
    with pytest.raises(LostVehicle):
        simulate(late(0.06, kind=kind), seed=0, tolerance=1.0)
    told = fly(late(0.06, kind=kind, command_delay=0.06), seed=0).metrics()["E_xy"]
    found = fly(late(0.06, kind=kind, track_delay=True), seed=0).metrics()["E_xy"]
    assert max(told, found) < 0.05  # [m]


def test_under_a_delay_the_oracle_stays_the_limit():
    config = late(0.06)
    np_error = fly(config, seed=0).metrics()["E_xy"]
    config.controller.kind = "oracle"
    oracle = fly(config, seed=0).metrics()["E_xy"]
    assert oracle < min(np_error, 0.004)  # [m]


def test_a_delay_that_no_controller_can_know_is_refused():
    with pytest.raises(ValueError, match="command_delay must be 0 to"):
        late(0.06, command_delay=0.5).check()
    with pytest.raises(ValueError, match="the oracle knows delays up to"):
        late(0.5, kind="oracle").check()
