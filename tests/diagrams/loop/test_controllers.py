"""Laws of controllers by name: their models, delays of commands, and flights with an autopilot."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.loop.controller_config import FILTER_MODEL, ControllerConfig
from diagrams.loop.controllers import kind_of_model, make_residual_model
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig, default_flight
from diagrams.loop.flight_diagram import make_flight_diagram, make_simulator
from diagrams.loop.flight_result import LostVehicle, fly
from np_drake.effects.effect_entry import EffectEntry
from np_drake.lifting.model.lifted_linear_system import Encoder, LiftedLinearSystem
from np_drake.lifting.model.lifted_model import MODE_DICTIONARY, LiftedModel
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.references.config import ReferenceConfig
from np_drake.residual_models.lifted_predictor import LiftedLinearPredictor
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop

VEHICLE = dc.replace(Vehicle(), rate_loop=RateLoop())


def circle(kind="payload_filter", delay=0.0, *, speed=1.5, **controller):
    config = FlightConfig(duration=2.5)
    config.reference = ReferenceConfig(track="circle", radius=1.0, speed=speed, ramp=2.5)
    config.controller = ControllerConfig(kind=kind, solver="sqp", **controller)
    config.reality.command_delay = delay
    return config


def test_each_kind_flies_the_packaged_model_of_its_name_on_its_own_vehicle():
    for kind, made in (("np", LiftedLinearPredictor), ("payload_filter", PayloadFilter)):
        assert isinstance(make_residual_model(ControllerConfig(kind), Vehicle()), made)
        with pytest.raises(ValueError, match="mass"):
            make_residual_model(ControllerConfig(kind), Vehicle(mass=1.0))


def test_a_lifted_linear_system_flies_as_np(tmp_path):
    path = tmp_path / "model.safetensors"
    system = LiftedLinearSystem(0.9 * np.eye(6), np.zeros((6, 6)), np.eye(6), 0.02)
    LiftedModel(MODE_DICTIONARY, system, Encoder(np.eye(6, 12))).save(path)
    config = ControllerConfig("np", predictor=str(path))
    assert isinstance(make_residual_model(config, Vehicle()), LiftedLinearPredictor)
    assert [kind_of_model(str(p)) for p in (path, FILTER_MODEL)] == ["np", "payload_filter"]
    with pytest.raises(ValueError, match="step must equal the period"):
        make_residual_model(dc.replace(config, period=0.01), Vehicle())


def test_the_diagram_of_np_holds_z_and_window_whose_step_is_linear():
    config = circle("np")
    simulator = make_simulator(make_flight_diagram(config), config, seed=0)
    simulator.AdvanceTo(1.5)
    dut = simulator.get_system().GetSubsystemByName("predictor")
    context = dut.GetMyContextFromRoot(simulator.get_context())
    z, window = (context.get_discrete_state(i).value() for i in (dut.z_index, dut.window_index))
    assert z.any()
    assert window.any()
    s, zeta = dut.GetOutputPort("lifted_linear_system").Eval(context), np.ones((2, 6))
    model = make_residual_model(config.controller, Vehicle())
    forecast = model.forecast(dut.memory(context), horizon=2, stride=1)
    expected = forecast.C @ (s.A @ z + s.B @ zeta[0]) + forecast.offset[1]
    np.testing.assert_allclose(forecast.rollout(zeta)[1], expected, rtol=0, atol=1e-12)


def test_the_payload_filter_finds_a_delay_in_flight_and_holds_the_circle():
    without, late = (fly(circle(delay=delay), seed=0).metrics() for delay in (0.0, 0.06))
    assert late["E_xy"] < 0.02  # [m]; with the first seconds
    assert late["command_delay"] == pytest.approx(0.06, abs=0.0051)  # a quarter period [s]
    assert late["wrench_rmse"]["force"] < 1.5 * without["wrench_rmse"]["force"]
    oracle = fly(circle("oracle", 0.06), seed=0).metrics()["E_xy"]
    assert oracle < min(late["E_xy"], 0.004)  # [m]; stays the limit


def test_a_controller_that_knows_or_finds_the_delay_holds_on():
    with pytest.raises(LostVehicle):
        fly(circle("hold", 0.06), seed=0, tolerance=0.5)
    told = fly(circle("hold", 0.06, command_delay=0.06), seed=0).metrics()
    found = fly(circle("nominal", 0.06, track_delay=True), seed=0).metrics()
    assert max(told["E_xy"], found["E_xy"]) < 0.05  # [m]
    assert told["command_delay"] == 0.06
    # The lag is not known to this kind, so that its estimate is coarser [s].
    assert found["command_delay"] == pytest.approx(0.06, abs=0.01)


LAGS = [("hold", 0.1, 0.06), ("observer", 0.04, 0.06), ("payload_filter", 0.0, 0.006)]


@pytest.mark.parametrize("kind, delay, most", [*LAGS, ("oracle", 0.0, 0.003)])
def test_a_lag_of_the_rotors_that_the_vehicle_file_tells_is_flown(kind, delay, most):
    config = circle(kind, delay, command_delay=delay)
    config.vehicle.rotor_time_constant, config.reality.motor_lag = 0.15, 0.0  # [s]
    assert fly(config, seed=0).metrics()["E_xy"] < most  # [m]


def test_a_delay_that_no_controller_can_know_is_refused():
    with pytest.raises(ValueError, match="command_delay must be 0 to"):
        circle(delay=0.06, command_delay=0.5).check()
    with pytest.raises(ValueError, match="the oracle knows delays up to"):
        circle("oracle", 0.5).check()


def piloted(kind="nominal", autopilot="rate_loop", **changes) -> FlightConfig:
    config = dc.replace(default_flight(VEHICLE), duration=2.0, **changes).with_autopilot(autopilot)
    config.controller.kind = kind
    config.reference.ramp = 2.0
    return config.check_and_step()


def test_predictors_fly_on_body_rates_which_the_log_holds():
    nominal, learned = (fly(piloted(kind), seed=1) for kind in ("nominal", "payload_filter"))
    assert learned.metrics()["E_xy"] < 0.4 * nominal.metrics()["E_xy"] < 0.03
    log, command = nominal.log(), nominal.signals["rates_thrust"]
    assert log.commanded_rates.shape == log.w.shape
    assert np.abs(log.commanded_rates).max() < RateLoop().max_rate[0]
    expected = RateLoop().torque(VEHICLE.J, nominal.signals["x"][:, 10:13], command[:, 1:])
    np.testing.assert_allclose(nominal.signals["u"][:, 1:], expected, atol=1e-9)
    np.testing.assert_allclose(nominal.signals["u"][:, 0], command[:, 0])


def test_flights_that_no_autopilot_flies_are_refused():
    for kind in ("oracle", "cascade"):
        with pytest.raises(ValueError, match=f"autopilot: {kind} commands torque"):
            piloted(kind)
    with pytest.raises(ValueError, match="must have a rate_loop"):
        piloted(vehicle=Vehicle())
    for part in ("autopilot", "controller"):
        with pytest.raises(ValueError, match="command must be rates with an autopilot"):
            dc.replace(piloted(), **{part: getattr(FlightConfig(), part)}).check()


def test_a_shifted_centre_of_mass_leaves_no_standing_command():
    config = dc.replace(load_experiment("hover", VEHICLE), duration=3.0).with_autopilot("rate_loop")
    config.controller.kind, config.reference.ramp = "hold", 0.5
    offset = EffectEntry("center_of_mass_offset", {"x": 0.005, "y": 0.0, "z": 0.0})
    shifted = dc.replace(config, reality=dc.replace(config.reality, effects=[offset]))
    rates = fly(shifted.check_and_step(), seed=1).log().commanded_rates
    assert abs(rates[-50:, 1].mean()) < 0.05  # [rad/s]; without an integral 0.35
