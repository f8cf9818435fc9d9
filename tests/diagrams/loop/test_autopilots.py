"""Laws of flights with an autopilot between the controller and the rotors."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.loop.flight import FlightConfig, default_flight
from diagrams.loop.flight_result import fly
from np_drake.rate_loop import RateLoop
from np_drake.vehicle import Vehicle

VEHICLE = dc.replace(Vehicle(), rate_loop=RateLoop())


def flight(kind="nominal", autopilot="rate_loop", **changes) -> FlightConfig:
    config = dc.replace(default_flight(VEHICLE), duration=4.0, **changes).with_autopilot(autopilot)
    config.controller.kind = kind
    return config.check_and_step()


@pytest.fixture(scope="module")
def flown():
    return {kind: fly(flight(kind), seed=1) for kind in ("nominal", "hold", "np")}


def test_every_predictor_flies_on_body_rates(flown):
    errors = {kind: one.metrics()["E_xy"] for kind, one in flown.items()}
    assert errors["np"] < 0.4 * errors["nominal"] < 0.03
    assert errors["np"] < errors["hold"]


def test_the_log_holds_the_commanded_rates(flown):
    log = flown["nominal"].log()
    assert log.commanded_rates.shape == log.w.shape
    assert np.abs(log.commanded_rates).max() < RateLoop().max_rate[0]


def test_the_logged_command_is_what_the_loop_is_assumed_to_make_of_it(flown):
    one = flown["nominal"]
    command, w = one.signals["rates_thrust"], one.signals["x"][:, 10:13]
    expected = RateLoop().torque(VEHICLE.J, w, command[:, 1:])
    np.testing.assert_allclose(one.signals["u"][:, 1:], expected, atol=1e-9)
    np.testing.assert_allclose(one.signals["u"][:, 0], command[:, 0])


@pytest.mark.parametrize("kind", ["oracle", "cascade"])
def test_controllers_of_torque_are_refused(kind):
    with pytest.raises(ValueError, match=f"autopilot: {kind} commands torque"):
        flight(kind)


def test_a_vehicle_without_a_rate_loop_is_refused():
    with pytest.raises(ValueError, match="must have a rate_loop"):
        flight(vehicle=Vehicle())


def test_an_autopilot_needs_commanded_rates_and_rates_an_autopilot():
    config = flight()
    for changed in (
        dc.replace(config, autopilot=FlightConfig().autopilot),
        dc.replace(config, controller=FlightConfig().controller),
    ):
        with pytest.raises(ValueError, match=r"controller\.mpc\.command must be rates with an autopilot"):
            changed.check()
