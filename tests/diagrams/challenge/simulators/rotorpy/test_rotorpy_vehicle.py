"""Laws of rotorpy's vehicle as a system of Drake."""

import numpy as np
import pytest

pytest.importorskip("rotorpy", reason="rotorpy is not installed: pip install 'np_drake[challenge]'")

from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from diagrams.challenge.simulators.rotorpy.rotorpy_vehicle import (
    OUTPUTS,
    RotorPyVehicle,
    make_rotorpy_vehicle,
)
from diagrams.challenge.simulators.rotorpy.vehicle import own_physics
from diagrams.loop.reality import RealityConfig, make_real_vehicle
from np_drake.effects.library import LIBRARY
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
PAYLOAD = LIBRARY["suspended_payload"](0.3, 0.8, 0.0, 0.0, -0.03)
LAG = LIBRARY["motor_lag"](0.03)
DELAY = LIBRARY["command_delay"](0.05)
FALLING = LIBRARY["thrust_drift"](1.0, -0.01)
OFFSET = LIBRARY["center_of_mass_offset"](0.0, 0.0, 0.02)
INERTIAL = [1.0, 0.0, 0.0, 0.0]


def port(system, context, name):
    return system.GetOutputPort(name).Eval(context).copy()


def hovering(*acting, own=False):
    dut = RotorPyVehicle(VEHICLE, acting, own=own)
    context = dut.CreateDefaultContext()
    dut.set_hover(context, np.array([1.0, -2.0, 3.0]))
    dut.get_input_port().FixValue(context, dut.hover_input)
    return dut, context


def advanced(system, u, seconds):
    """The state of `system` after that time under a constant command."""
    simulator = Simulator(system)
    scheme = SimulatorConfig(
        integration_scheme="runge_kutta3", max_step_size=1e-3, use_error_control=False
    )
    ApplySimulatorConfig(scheme, simulator)
    system.GetInputPort("u").FixValue(simulator.get_mutable_context(), u)
    simulator.AdvanceTo(seconds)
    return simulator.get_context()


@pytest.mark.parametrize("acting", [[], [PAYLOAD], [LAG], [PAYLOAD, LAG, OFFSET]], ids=str)
def test_at_rest_in_hover_nothing_accelerates(acting):
    dut, context = hovering(*acting)
    np.testing.assert_allclose(
        port(dut, context, "acceleration"), 0.0, atol=1e-12
    )  # [m/s², rad/s²]
    np.testing.assert_allclose(
        port(dut, context, "x"), [1, -2, 3, *INERTIAL, *np.zeros(6)], atol=1e-12
    )
    weight = dut.hover_input[0]
    np.testing.assert_allclose(port(dut, context, "rotor_thrust"), weight / 4)
    np.testing.assert_allclose(port(dut, context, "nominal_rotor_thrust"), weight / 4)
    assert np.abs(dut.EvalTimeDerivatives(context).CopyToVector()).max() < 1e-12


def test_its_ports_are_those_of_the_other_vehicle():
    dut = make_rotorpy_vehicle(VEHICLE, [DELAY])
    other = make_real_vehicle(VEHICLE, RealityConfig().nominal())
    assert dut.GetInputPort("u").size() == 4
    assert [dut.GetOutputPort(n).size() for n in OUTPUTS] == [
        other.GetOutputPort(n).size() for n in OUTPUTS
    ]


def test_the_payload_stands_in_the_plant_state():
    dut, context = hovering(PAYLOAD)
    s = port(dut, context, "plant_state")
    expected = [*INERTIAL, 1.0, -2.0, 3.0, *INERTIAL, 1.0, -2.0, 3.0 - 0.83, *np.zeros(12)]
    np.testing.assert_allclose(s, expected, atol=1e-12)


def test_the_nominal_vehicle_moves_open_loop_as_the_other():
    u = VEHICLE.hover_input * 1.1 + [0.0, 0.01, -0.02, 0.005]  # tumbles
    dut, other = (
        make_rotorpy_vehicle(VEHICLE, []),
        make_real_vehicle(VEHICLE, RealityConfig().nominal()),
    )
    found, expected = (port(system, advanced(system, u, 2.0), "x") for system in (dut, other))
    assert np.abs(expected[10:]).max() > 0.5  # [rad/s]
    np.testing.assert_allclose(found, expected, atol=1e-8)  # runge_kutta3 at 1 ms


def test_its_own_air_drags_and_lifts_with_the_turning_rotors():
    dut, context = hovering(own=True)
    v, c = np.array([1.5, -0.5, 0.2]), own_physics()
    s = context.get_continuous_state_vector().CopyToVector()
    s[3:6] = v
    context.SetContinuousState(s)
    turning = s[16:20].sum()  # of all rotors [rad/s]
    force = -turning * np.array([c["k_d"], c["k_d"], c["k_z"]]) * v
    force -= np.linalg.norm(v) * np.array([c["c_Dx"], c["c_Dy"], c["c_Dz"]]) * v
    force[2] += 4 * c["k_h"] * (v[0] ** 2 + v[1] ** 2)
    np.testing.assert_allclose(
        port(dut, context, "acceleration")[:3], force / VEHICLE.mass, atol=1e-12
    )
    assert np.linalg.norm(force) > 0.3  # [N]


def test_its_own_motors_lag_unless_an_effect_is_slower():
    for acting, constant in ([], own_physics()["tau_m"]), ([LAG], 0.03):
        dut, context = hovering(*acting, own=True)
        dut.get_input_port().FixValue(context, 2.25 * dut.hover_input)
        speed = context.get_continuous_state_vector().CopyToVector()[16:20]
        rate = dut.EvalTimeDerivatives(context).CopyToVector()[16:20]
        np.testing.assert_allclose(
            rate, 0.5 * speed / constant
        )  # 2.25 of the thrust is 1.5 of the speed


def test_commands_saturate_in_rotor_space():
    dut, context = hovering()
    u = np.array([30.0, 8.0, 0.0, 0.0])
    dut.get_input_port().FixValue(context, u)
    np.testing.assert_allclose(
        VEHICLE.mixer @ port(dut, context, "rotor_thrust"), VEHICLE.saturate(u)
    )
    assert not np.allclose(VEHICLE.saturate(u), u)


def test_late_commands_act_after_the_dead_time():
    dut, u = make_rotorpy_vehicle(VEHICLE, [DELAY], command_period=0.01), 1.2 * VEHICLE.hover_input
    for seconds, thrust in ((0.049, VEHICLE.hover_input[0] / 4), (0.051, u[0] / 4)):
        np.testing.assert_allclose(port(dut, advanced(dut, u, seconds), "rotor_thrust"), thrust)


def test_acceleration_is_the_rate_of_velocity_of_the_origin():
    dut = make_rotorpy_vehicle(VEHICLE, [OFFSET, LAG])
    u = VEHICLE.hover_input + [0.0, 0.02, -0.03, 0.01]
    before, now, after = (advanced(dut, u, t) for t in (0.499, 0.5, 0.501))
    rate = (port(dut, after, "x") - port(dut, before, "x"))[7:] / 0.002
    np.testing.assert_allclose(
        port(dut, now, "acceleration"), rate, atol=1e-4
    )  # of a central difference


def test_outputs_follow_command_and_time():
    dut, context = hovering(FALLING)
    dut.get_input_port().FixValue(context, 1.1 * dut.hover_input)
    first = port(dut, context, "acceleration")[2]
    np.testing.assert_allclose(first, 0.1 * VEHICLE.gravity)
    dut.get_input_port().FixValue(context, 1.2 * dut.hover_input)
    np.testing.assert_allclose(port(dut, context, "acceleration")[2], 0.2 * VEHICLE.gravity)
    context.SetTime(10.0)
    np.testing.assert_allclose(port(dut, context, "acceleration")[2], 0.08 * VEHICLE.gravity)


def test_two_contexts_never_influence_each_other():
    dut, first = hovering(PAYLOAD, LAG)
    alone = port(dut, first, "acceleration")
    second = dut.CreateDefaultContext()
    dut.get_input_port().FixValue(second, [5.0, 0.1, 0.0, 0.0])
    port(dut, second, "acceleration")
    dut.get_input_port().FixValue(first, dut.hover_input)
    np.testing.assert_array_equal(port(dut, first, "acceleration"), alone)


def test_a_state_that_is_not_finite_ends_the_simulation():
    dut, context = hovering()
    context.SetContinuousState(np.full(20, np.nan))
    with pytest.raises(RuntimeError, match="must be finite"):
        port(dut, context, "x")
