import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource, VectorLogSink
from pydrake.trajectories import PiecewisePolynomial

from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.vehicle import Vehicle
from systems.command_buffer import CommandBuffer
from systems.tethered_quadrotor import PayloadConfig, make_tethered_quadrotor

VEHICLE, STEP = Vehicle(), 0.01


def commands(n=20):
    return np.random.default_rng(0).uniform(2.0, 9.0, (n, 4))


def thrusts_in_drake(effects, command, *, command_period, samples=20):
    """(n, samples, 4) rotor thrust [N] at midpoints of equal parts of each held command."""
    dut = make_tethered_quadrotor(
        VEHICLE,
        PayloadConfig(tether="none"),
        actuator_effects=effects,
        command_period=command_period,
    )
    simulator = Simulator(dut)
    scheme = SimulatorConfig(
        integration_scheme="runge_kutta3", max_step_size=1e-3, use_error_control=False
    )
    ApplySimulatorConfig(scheme, simulator)
    context, out = simulator.get_mutable_context(), []
    port = dut.GetOutputPort("rotor_thrust")
    for k, row in enumerate(command):
        dut.GetInputPort("u").FixValue(context, VEHICLE.mixer @ row)
        for i in range(samples):
            simulator.AdvanceTo(STEP * (k + (i + 0.5) / samples))
            out.append(port.Eval(context))
        simulator.AdvanceTo(STEP * (k + 1))
    return np.reshape(out, (len(command), samples, 4))


@pytest.mark.parametrize("delay, command_period", [(0.004, 0.01), (0.0275, 0.001), (0.03, 0.01)])
def test_drake_delays_by_as_much_as_the_pure_function(delay, command_period):
    hover = np.full((5, 4), VEHICLE.mass * VEHICLE.gravity / 4)
    command = np.vstack([hover, commands()])
    found = thrusts_in_drake([CommandDelay(delay)], command, command_period=command_period)
    expected = CommandDelay(delay).respond(VEHICLE, STEP * np.arange(25), command)
    np.testing.assert_allclose(found.mean(axis=1), expected, atol=1e-9)


def test_lag_after_delay_responds_in_drake_as_in_the_pure_functions():
    effects = [CommandDelay(0.015), MotorLag(0.03), ThrustScale(0.9)]
    hover = np.full((5, 4), VEHICLE.mass * VEHICLE.gravity / 4)
    command = np.vstack([hover, commands()])
    found = thrusts_in_drake(effects, command, command_period=0.01)
    t = 0.005 * np.arange(50)  # half rows, so that the delayed command is held over each
    expected = np.repeat(command, 2, axis=0)
    for effect in effects:
        expected = effect.respond(VEHICLE, t, expected)
    # [N]: midpoints
    np.testing.assert_allclose(found.reshape(50, 10, 4).mean(axis=1), expected, atol=2e-3)


def buffer_behind_a_staircase(period):
    builder = DiagramBuilder()
    steps = PiecewisePolynomial.ZeroOrderHold(np.arange(0, 1.0, 0.1), np.arange(10.0)[None] + 1)
    source = builder.AddSystem(TrajectorySource(steps))
    dut = builder.AddSystem(CommandBuffer(np.array([-1.0]), dead_time=0.25, period=period))
    sink = builder.AddSystem(VectorLogSink(1, 0.01))
    builder.Connect(source.get_output_port(), dut.get_input_port())
    builder.Connect(dut.get_output_port(), sink.get_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.9)
    return sink.FindLog(simulator.get_context())


@pytest.mark.parametrize("period", [0.1, 0.02])
def test_the_resting_value_holds_until_the_start_then_each_command(period):
    log = buffer_behind_a_staircase(period)
    # a sample at an instant sees what was before it
    t, found = (log.sample_times() - 0.005, log.data()[0])
    expected = np.where(t < 0.25, -1.0, np.floor((t - 0.25) / 0.1 + 1e-6) + 1)
    np.testing.assert_array_equal(found, expected)
