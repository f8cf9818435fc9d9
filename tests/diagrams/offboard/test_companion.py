"""Laws of the controller that is stepped without a Simulator."""

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator

from diagrams.loop.flight_diagram import make_flight_diagram, set_initial_state
from diagrams.offboard.companion import Companion, make_companion_diagram
from diagrams.offboard.study import flight
from np_drake.mpc.problem import MpcStatus


@pytest.mark.parametrize("controller", ["np", "observer"])
def test_it_commands_what_the_diagram_of_a_flight_commands(controller):
    config = flight(controller)
    diagram = make_flight_diagram(config)
    simulator = Simulator(diagram)
    ApplySimulatorConfig(config.simulator, simulator)
    context = simulator.get_mutable_context()
    set_initial_state(diagram, context, config, seed=3)
    sensors, mpc = diagram.GetSubsystemByName("sensor_model"), diagram.GetSubsystemByName("np_mpc")

    def read(system, name):
        return system.GetOutputPort(name).Eval(system.GetMyContextFromRoot(context)).copy()

    dut, in_force = Companion(config), read(mpc, "rates_thrust")
    for k in range(60):
        if k > 0:
            simulator.AdvanceTo(k * config.controller.period)
        x, acceleration = read(sensors, "x"), read(sensors, "acceleration")
        simulator.AdvancePendingEvents()
        answer = dut.step(context.get_time(), x=x, acceleration=acceleration, in_force=in_force)
        in_force = read(mpc, "rates_thrust")
        np.testing.assert_allclose(answer.rates_thrust, in_force, rtol=0, atol=1e-9)


def test_after_a_reset_it_answers_as_a_new_one():
    config = flight("hold")
    dut, x = Companion(config), np.array([1.0, 0.0, 1.6, 1.0, *np.zeros(9)])
    acceleration, in_force = (
        np.array([0.1, 0.0, -1.0, 0.0, 0.0, 0.0]),
        np.array([20.0, 0.1, 0.0, 0.0]),
    )
    first = [
        dut.step(0.02 * k, x=x, acceleration=acceleration, in_force=in_force).rates_thrust
        for k in range(5)
    ]
    dut.reset()
    again = [
        dut.step(0.02 * k, x=x, acceleration=acceleration, in_force=in_force).rates_thrust
        for k in range(5)
    ]
    np.testing.assert_array_equal(first, again)
    assert not np.allclose(first[0], first[-1])


def test_a_state_that_is_not_measured_is_answered_by_the_last_plan():
    dut, x = Companion(flight("hold")), np.array([1.0, 0.0, 1.6, 1.0, *np.zeros(9)])
    rest = {"acceleration": np.zeros(6), "in_force": np.array([19.62, 0.0, 0.0, 0.0])}
    assert dut.step(0.0, x=x, **rest).status == MpcStatus.OPTIMAL
    answer = dut.step(0.02, x=np.full(13, np.nan), **rest)
    assert answer.status == MpcStatus.SHIFTED_PLAN
    assert np.isfinite(answer.rates_thrust).all()


def test_a_step_of_an_earlier_memory_leaves_the_present_one_alone():
    dut, x = Companion(flight("hold")), np.array([1.0, 0.0, 1.6, 1.0, *np.zeros(9)])
    rest = {"x": x, "in_force": np.array([19.62, 0.0, 0.0, 0.0])}
    earlier = dut.context
    dut.reset()
    dut.step(0.0, acceleration=np.array([0.0, 0.0, -3.0, 0.0, 0.0, 0.0]), context=earlier, **rest)
    fresh = Companion(flight("hold")).step(0.0, acceleration=np.zeros(6), **rest)
    np.testing.assert_array_equal(
        dut.step(0.0, acceleration=np.zeros(6), **rest).rates_thrust, fresh.rates_thrust
    )


def test_a_controller_of_rotor_thrusts_is_refused():
    with pytest.raises(ValueError, match=r"command must be rates"):
        make_companion_diagram(flight("hold").with_autopilot("none"))
