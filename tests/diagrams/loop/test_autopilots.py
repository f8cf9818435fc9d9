"""Laws of flights with an autopilot between the controller and the rotors."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig, default_flight, load_flight
from diagrams.loop.flight_result import fly
from np_drake.effects.effect_entry import EffectEntry
from np_drake.identification.rate_loop import identify_rate_loop
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.scaling import ratios, usual_rate_loop
from np_drake.vehicle.vehicle import RateLoop

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


def test_a_scenario_file_names_the_autopilot_alone(tmp_path):
    (tmp_path / "a.yaml").write_text(
        "autopilot: {kind: rate_loop}\nvehicle: {rate_loop: {lag: [0.1, 0.1, 0.3]}}\n"
    )
    config = load_flight(str(tmp_path / "a.yaml"))
    assert config.controller.mpc.command == "rates"
    assert config.vehicle.rate_loop.lag == [0.1, 0.1, 0.3]


def test_bandwidth_and_usual_loop_keep_the_pace_of_the_vehicle():
    small, pace = load_vehicle("crazyflie"), ratios(load_vehicle("crazyflie")).time
    assert default_flight(small).autopilot.betaflight.bandwidth == pytest.approx(
        [20 / pace, 20 / pace, 5 / pace]
    )
    assert usual_rate_loop(small).lag == pytest.approx([0.075 * pace, 0.075 * pace, 0.2 * pace])


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
        with pytest.raises(
            ValueError, match=r"controller\.mpc\.command must be rates with an autopilot"
        ):
            changed.check()


def test_the_loop_that_flies_is_that_of_the_file_whatever_the_rotors_lag():
    config = dc.replace(load_experiment("training_circle", VEHICLE), duration=25.0).with_autopilot(
        "rate_loop"
    )
    bare = dc.replace(config.reality.nominal(), motor_lag=0.05)
    loops = identify_rate_loop(
        [fly(dc.replace(config, reality=bare).check_and_step(), seed=2).log()]
    )
    assert [loop.lag for loop in loops] == pytest.approx(VEHICLE.rate_loop.lag, rel=0.03)
    assert [loop.gain for loop in loops] == pytest.approx([1.0, 1.0, 1.0], abs=0.03)


def test_a_shifted_centre_of_mass_leaves_no_standing_command():
    config = dc.replace(load_experiment("hover", VEHICLE), duration=6.0).with_autopilot("rate_loop")
    config.controller.kind = "hold"
    offset = EffectEntry("center_of_mass_offset", {"x": 0.005, "y": 0.0, "z": 0.0})
    shifted = dc.replace(config, reality=dc.replace(config.reality, effects=[offset]))
    rates = fly(shifted.check_and_step(), seed=1).log().commanded_rates
    assert abs(rates[-100:, 1].mean()) < 0.03  # [rad/s]; without an integral 0.35
