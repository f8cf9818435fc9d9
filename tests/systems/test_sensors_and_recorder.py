"""Laws of the sensors and of the recorder."""

import numpy as np
import pytest
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, DiscreteTimeIntegrator, ZeroOrderHold

from np_drake.effects.base import Measurement, SensorEffect
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.library import LIBRARY
from np_drake.effects.sensor_noise import SensorNoise
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle
from systems.recorder import add_recorder
from systems.sensor_model import make_sensor_model

LEVEL = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0, 0, 0, 0, 0, 0])


def rig_with(effects):
    dut = make_sensor_model(Vehicle(), effects, period=0.02)
    simulator = Simulator(dut)
    context = simulator.get_mutable_context()
    dut.GetInputPort("x_true").FixValue(context, LEVEL)
    dut.GetInputPort("acceleration_true").FixValue(context, np.zeros(6))
    dut.GetInputPort("nominal_rotor_thrust").FixValue(context, np.full(4, 4.0))
    return dut, simulator, context


def test_noise_repeats_by_seed_and_changes_between_instants():
    readings = []
    for seed in (1, 1, 2):
        dut, simulator, context = rig_with([SensorNoise(MeasurementNoise())])
        dut.SetRandomContext(context, RandomGenerator(seed))
        simulator.AdvanceTo(0.05)
        early = dut.GetOutputPort("x").Eval(context).copy()
        simulator.AdvanceTo(0.09)
        readings.append((early, dut.GetOutputPort("x").Eval(context).copy()))
    np.testing.assert_array_equal(readings[0], readings[1])
    assert not np.array_equal(readings[0], readings[2])
    assert not np.array_equal(readings[0][0], readings[0][1])


def test_row_k_holds_what_acts_just_after_its_instant():
    builder = DiagramBuilder()
    # Counts its own updates: 1 from t = 0 on, 2 from t = 0.1 on.
    one = builder.AddSystem(ConstantVectorSource([10.0]))
    counter = builder.AddSystem(DiscreteTimeIntegrator(1, 0.1))
    held = builder.AddSystem(ZeroOrderHold(0.1, 1))
    builder.Connect(one.get_output_port(), counter.get_input_port())
    builder.Connect(counter.get_output_port(), held.get_input_port())
    recorder = add_recorder(
        builder, {"count": counter.get_output_port(), "held": held.get_output_port()}, period=0.1
    )
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.55)
    rows = recorder.read(diagram, simulator.get_context())
    np.testing.assert_allclose(rows["t"], [0, 0.1, 0.2, 0.3, 0.4], atol=1e-12)
    np.testing.assert_allclose(rows["count"][:, 0], [1, 2, 3, 4, 5])
    np.testing.assert_allclose(rows["held"][:, 0], [0, 1, 2, 3, 4])


VEHICLE = Vehicle()
SENSORS = [e() for e in LIBRARY.values() if issubclass(e, SensorEffect) and e is not ClockOffset]


def read_by_the_rig(effects, truth):
    dut = make_sensor_model(VEHICLE, effects, period=0.02)
    context = dut.CreateDefaultContext()
    dut.GetInputPort("x_true").FixValue(context, truth.x)
    dut.GetInputPort("acceleration_true").FixValue(context, np.concatenate([truth.a, truth.al]))
    thrust = VEHICLE.thrust_coefficient * truth.rotor**2
    dut.GetInputPort("nominal_rotor_thrust").FixValue(context, thrust)
    return [dut.GetOutputPort(name).Eval(context) for name in ("x", "acceleration", "rotor_speed")]


@pytest.mark.parametrize(
    "effects", [*([e] for e in SENSORS), SENSORS], ids=lambda e: e[-1].identifier
)
def test_the_rig_reads_what_the_pure_functions_say(effects):
    rng = np.random.default_rng(0)
    x = rng.normal(size=13)
    x[3:7] /= np.linalg.norm(x[3:7])
    truth = Measurement(x, rng.normal(size=3), rng.normal(size=3), rng.uniform(500, 900, 4))
    found = read_by_the_rig(effects, truth)
    expected = truth
    for effect in effects:
        expected = effect.measure(VEHICLE, expected, np.zeros(0))
    np.testing.assert_allclose(found[0], expected.x, atol=1e-12)
    np.testing.assert_allclose(found[1], [*expected.a, *expected.al], atol=1e-12)
    np.testing.assert_allclose(found[2], truth.rotor, rtol=1e-12)
    assert np.abs(np.concatenate([found[0] - x, found[1] - [*truth.a, *truth.al]])).max() > 1e-3
