"""Laws of the LeafSystems around a delay of commands."""

import numpy as np
import pytest

from np_drake.command_delay import KEPT, DelayFilter
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.pendulum import Payload
from np_drake.effects.thrust_drift import ThrustDrift
from np_drake.mpc.problem import MpcConfig
from np_drake.references.config import ReferenceConfig, make_reference
from np_drake.residual_models.hold import Hold
from np_drake.residual_models.oracle import TrueModel
from np_drake.vehicle import Vehicle
from systems.delay_estimator import DelayEstimator
from systems.reference_source import ReferenceSource
from systems.residual_predictor import ResidualPredictor
from systems.wrench_oracle import WrenchOracle
from tests.systems.conftest import evaluate, event

STEP, VEHICLE, CONFIG = 0.02, Vehicle(), MpcConfig(horizon=5)
LEVEL = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0])
HOVER = VEHICLE.hover_input


def estimator(known):
    dut = DelayEstimator(DelayFilter(VEHICLE, step=STEP, known=known, track=False))
    context = dut.CreateDefaultContext()
    dut.GetInputPort("x").FixValue(context, LEVEL)
    dut.GetInputPort("acceleration").FixValue(context, np.zeros(6))
    for turn in range(1, 6):
        dut.GetInputPort("u").FixValue(context, turn * np.ones(4))
        if turn < 5:
            event(dut, context)
    return dut, context


@pytest.mark.parametrize("delay, acting", [(0.0, 5.0), (0.02, 4.0), (0.03, 3.5), (0.06, 2.0)])
def test_the_command_that_acts_was_sent_a_delay_before(delay, acting):
    dut, context = estimator(delay)
    np.testing.assert_allclose(evaluate(dut, context, "acting"), acting)
    np.testing.assert_allclose(evaluate(dut, context, "delay"), delay)
    np.testing.assert_allclose(
        evaluate(dut, context, "sent").reshape(KEPT, 4)[:5, 0], [5, 4, 3, 2, 1]
    )


def test_the_reference_is_read_where_the_next_command_acts():
    reference = make_reference(ReferenceConfig())
    dut = ReferenceSource(reference, horizon=4, step=0.04)
    context = dut.CreateDefaultContext()
    context.SetTime(7.0)
    dut.GetInputPort("lead").FixValue(context, [0.05])
    flat = evaluate(dut, context, "flat").reshape(5, 5, 3)
    np.testing.assert_allclose(flat, reference.sample(7.05 + 0.04 * np.arange(5)))
    np.testing.assert_allclose(
        evaluate(dut, context, "position"), reference.sample(np.array([7.0]))[0, 0]
    )


def predictor(delay, x=LEVEL):
    dut = ResidualPredictor(Hold(step=STEP), horizon=4, stride=2, vehicle=VEHICLE)
    context = dut.CreateDefaultContext()
    values = {
        "x": x,
        "u": HOVER,
        "label": np.zeros(6),
        "sent": np.tile(HOVER, KEPT),
        "delay": [delay],
    }
    for name, value in values.items():
        dut.GetInputPort(name).FixValue(context, value)
    return evaluate(dut, context, "forecast")


def test_a_forecast_begins_where_the_next_command_will_act():
    start = predictor(0.05).start
    np.testing.assert_allclose(start[:3], LEVEL[:3] + [0.05 * 0.5, 0, 0], atol=1e-12)
    np.testing.assert_allclose(start[3:], LEVEL[3:], atol=1e-12)


def test_without_delay_or_without_a_state_a_forecast_begins_now():
    assert predictor(0.0).start is None
    assert predictor(0.05, np.full(13, np.nan)).start is None


STILL = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0, 0, 0, 0, 0, 0])


def foreseen(model, *, time=0.0, **values):
    """What an oracle forecasts of these inputs; where none is given, in hover."""
    dut = WrenchOracle(model, CONFIG, period=STEP)
    context = dut.CreateDefaultContext()
    context.SetTime(time)
    hover = {"rotor_thrust": np.full(4, HOVER[0] / 4), "plan_u": np.tile(HOVER, 5)}
    for name, value in (hover | {"plan_x": np.tile(STILL, 6)} | values).items():
        dut.GetInputPort(name).FixValue(context, value)
    return evaluate(dut, context, "forecast")


def test_the_oracle_knows_the_commands_that_are_under_way():
    """At 0.5 m/s against drag, with 10 % more thrust under way."""
    forecast = foreseen(
        TrueModel(VEHICLE, None, [LinearDrag(0.25, 0.25, 0.25)], [], 0.05),
        plan_x=np.tile(LEVEL, 6),
        plant_state=np.array([1.0, 0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0.5, 0, 0]),
        x=LEVEL,
        sent=np.tile(1.1 * HOVER, KEPT),
        delay=[0.05],
    )
    climb = 0.1 * VEHICLE.gravity * 0.05  # of 10 % more thrust over the delay [m/s]
    np.testing.assert_allclose(forecast.start[9], climb, rtol=0.02)
    np.testing.assert_allclose(
        forecast.start[7], 0.5 * np.exp(-0.25 / VEHICLE.mass * 0.05), rtol=1e-3
    )


def test_a_payload_to_the_side_pulls_to_the_side_and_turns_the_body():
    state, angle = np.zeros(26), 0.3
    state[[0, 7]] = 1.0
    state[4:7] = [0, 0, 1.0]
    state[11:14] = [0.8 * np.sin(angle), 0, 1.0 - 0.025 - 0.8 * np.cos(angle)]
    chi = foreseen(TrueModel(VEHICLE, Payload(), [], []), plant_state=state).offset[0]
    tension = 0.26 * 9.81 * np.cos(angle)
    np.testing.assert_allclose(
        chi[:3], tension * np.array([np.sin(angle), 0, -np.cos(angle)]), rtol=0.02, atol=1e-9
    )
    assert chi[4] == np.float64(-0.025 * chi[0])  # hook below the centre of mass


def test_a_drift_is_foreseen_from_the_flights_own_time():
    model = TrueModel(VEHICLE, None, [], [ThrustDrift(1.0, -0.01)])
    state, thrust = np.array([1.0, *np.zeros(12)]), np.full(4, 0.9 * HOVER[0] / 4)
    chi = foreseen(model, time=10.0, rotor_thrust=thrust, plant_state=state).offset
    np.testing.assert_allclose(chi[0, 2], -0.1 * HOVER[0], rtol=0.01)
