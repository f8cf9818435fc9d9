import numpy as np
import pytest
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, DiscreteTimeIntegrator, ZeroOrderHold

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


def test_without_effects_the_rig_reads_the_truth():
    dut, _, context = rig_with([])
    np.testing.assert_array_equal(dut.GetOutputPort("x").Eval(context), LEVEL)
    np.testing.assert_allclose(dut.GetOutputPort("rotor_speed").Eval(context), np.sqrt(4.0 / 1e-5))


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


def test_controller_and_log_read_the_same_noise_at_an_instant():
    dut, simulator, context = rig_with([SensorNoise(MeasurementNoise())])
    simulator.AdvanceTo(0.0599999)
    before = dut.GetOutputPort("x").Eval(context).copy()
    simulator.AdvanceTo(0.0600011)
    np.testing.assert_array_equal(dut.GetOutputPort("x").Eval(context), before)


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


@pytest.mark.parametrize("name", ["x", "acceleration", "rotor_speed"])
def test_rig_ports_have_names(name):
    dut, _, context = rig_with([SensorNoise(MeasurementNoise())])
    assert np.isfinite(dut.GetOutputPort(name).Eval(context)).all()
