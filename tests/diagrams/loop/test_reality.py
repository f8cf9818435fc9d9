"""Laws of the real vehicle's delay and battery."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig, RealityConfig, load_flight
from diagrams.loop.flight_diagram import make_flight_diagram
from diagrams.loop.flight_result import fly
from diagrams.loop.real_vehicle import make_real_vehicle
from diagrams.loop.scaled import scaled
from diagrams.studies.robustness import BASE, flight_config
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import ratios, similar


def thrusts(reality, times, command=1.1):
    """Return the mean rotor thrust at `times` (n,) [s] after a step of the hover command at t = 0
    [N].
    """
    vehicle = Vehicle()
    dut = make_real_vehicle(vehicle, reality, command_period=0.02)
    simulator = Simulator(dut)
    context = simulator.get_mutable_context()
    dut.GetInputPort("u").FixValue(context, command * vehicle.hover_input)
    found = []
    for t in times:
        simulator.AdvanceTo(t)
        found.append(dut.GetOutputPort("rotor_thrust").Eval(context).mean())
    return np.array(found)


def bare(**fields):
    reality = RealityConfig(motor_lag=0.0, thrust_scale=1.0, rotor_drag=0.0, **fields)
    reality.payload.tether = "none"
    return reality.check()


@pytest.mark.parametrize("delay", [0.02, 0.045, 0.08])
def test_a_command_acts_after_its_delay(delay):
    hover = Vehicle().mass * Vehicle().gravity / 4  # [N]
    found = thrusts(bare(command_delay=delay), [delay - 1e-4, delay + 1e-4])
    np.testing.assert_allclose(found, [hover, 1.1 * hover], rtol=1e-12)


def test_a_battery_loses_its_share_of_the_starting_thrust_each_second():
    reality = bare(thrust_loss=0.1)
    found = thrusts(reality, [0.001, 0.5, 1.0])
    np.testing.assert_allclose(
        found / thrusts(bare(), [0.001])[0], 1.0 - 0.1 * np.array([0.001, 0.5, 1.0])
    )
    assert RealityConfig(thrust_scale=0.9, thrust_loss=0.1).thrust_at(
        Vehicle(), 2.0
    ) == pytest.approx(0.9 * 0.8)


def test_a_delay_of_the_axis_reaches_the_plant_at_the_controllers_period():
    config = flight_config({"seed": 1, **BASE, "delay": 0.045}, solver="sqp")
    diagram = make_flight_diagram(config)
    buffer = diagram.GetSubsystemByName("tethered_quadrotor").GetSubsystemByName("command_buffer")
    readings = buffer.CreateDefaultContext().get_discrete_state(0).size()
    assert readings == 4 * (2 + 1)  # two whole periods of 20 ms in 45 ms, and the offset's reading
    base = make_flight_diagram(flight_config({"seed": 1, **BASE}, solver="sqp"))
    assert not base.GetSubsystemByName("tethered_quadrotor").HasSubsystemNamed("command_buffer")


def test_a_delayed_flight_is_another_flight_and_a_short_delay_is_borne():
    config = load_experiment("circle")
    config.duration, config.reference.ramp, config.controller.solver = 1.0, 1.0, "sqp"
    on_time = fly(config, seed=1)
    config.reality.command_delay = 0.01  # [s]
    late = fly(config, seed=1)
    assert late.metrics()["E_xy"] < 0.1  # [m]
    assert np.abs(late.signals["x_true"] - on_time.signals["x_true"]).max() > 1e-4


@pytest.mark.parametrize("name", ["command_delay", "thrust_loss"])
@pytest.mark.parametrize("value", [-0.01, np.inf, np.nan])
def test_impossible_delays_and_losses_are_refused(name, value):
    with pytest.raises(ValueError, match=f"{name} must not be negative"):
        RealityConfig(**{name: value}).check()


def test_a_battery_that_does_not_last_the_flight_is_refused():
    with pytest.raises(ValueError, match="more than the rotors can carry"):
        FlightConfig(
            duration=50.0, reality=RealityConfig(thrust_loss=0.015)
        ).check()  # 17 % left after 55 s
    assert FlightConfig(duration=10.0, reality=RealityConfig(thrust_loss=0.015)).check()


def test_a_scenario_file_names_delay_and_loss(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("reality: {command_delay: 0.03, thrust_loss: 0.002}\nduration: 20.0\n")
    reality = load_flight(str(file)).reality
    assert (reality.command_delay, reality.thrust_loss) == (0.03, 0.002)


def test_delay_and_loss_scale_with_the_vehicles_time():
    small = similar(Vehicle(), length=0.25)
    config = FlightConfig(
        vehicle=small, reality=RealityConfig(command_delay=0.03, thrust_loss=0.002)
    )
    dut, time = scaled(config).reality, ratios(small).time
    assert time != 1.0
    assert dut.command_delay == pytest.approx(0.03 * time)
    assert dut.thrust_loss == pytest.approx(0.002 / time)
