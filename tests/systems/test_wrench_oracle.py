import numpy as np

from np_drake.effects.pendulum import Payload
from np_drake.effects.thrust_drift import ThrustDrift
from np_drake.mpc.problem import MpcConfig
from np_drake.residual_models.oracle import TrueModel
from np_drake.vehicle import Vehicle
from systems.wrench_oracle import WrenchOracle

VEHICLE, CONFIG = Vehicle(), MpcConfig(horizon=5)
LEVEL = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0, 0, 0, 0, 0, 0])


def oracle_over(payload):
    dut = WrenchOracle(TrueModel(VEHICLE, payload, [], []), CONFIG, period=0.02)
    context = dut.CreateDefaultContext()
    dut.GetInputPort("rotor_thrust").FixValue(context, np.full(4, VEHICLE.hover_input[0] / 4))
    dut.GetInputPort("plan_u").FixValue(context, np.tile(VEHICLE.hover_input, 5))
    dut.GetInputPort("plan_x").FixValue(context, np.tile(LEVEL, 6))
    return dut, context


def test_a_payload_to_the_side_pulls_to_the_side_and_turns_the_body():
    dut, context = oracle_over(Payload())
    state = np.zeros(26)
    state[[0, 7]] = 1.0
    angle = 0.3
    state[4:7] = [0, 0, 1.0]
    state[11:14] = [0.8 * np.sin(angle), 0, 1.0 - 0.025 - 0.8 * np.cos(angle)]
    dut.GetInputPort("plant_state").FixValue(context, state)
    chi = dut.GetOutputPort("forecast").Eval(context).offset[0]
    tension = 0.26 * 9.81 * np.cos(angle)
    np.testing.assert_allclose(
        chi[:3], tension * np.array([np.sin(angle), 0, -np.cos(angle)]), rtol=0.02, atol=1e-9
    )
    assert chi[4] == np.float64(-0.025 * chi[0])  # hook below the centre of mass


def test_a_drift_is_foreseen_from_the_flights_own_time():
    dut = WrenchOracle(TrueModel(VEHICLE, None, [], [ThrustDrift(1.0, -0.01)]), CONFIG, period=0.02)
    context = dut.CreateDefaultContext()
    context.SetTime(10.0)
    dut.GetInputPort("rotor_thrust").FixValue(context, np.full(4, 0.9 * VEHICLE.hover_input[0] / 4))
    dut.GetInputPort("plan_u").FixValue(context, np.tile(VEHICLE.hover_input, 5))
    dut.GetInputPort("plan_x").FixValue(context, np.tile(LEVEL, 6))
    dut.GetInputPort("plant_state").FixValue(context, np.array([1.0, *np.zeros(12)]))
    chi = dut.GetOutputPort("forecast").Eval(context).offset
    np.testing.assert_allclose(chi[0, 2], -0.1 * VEHICLE.hover_input[0], rtol=0.01)
