import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from np_drake.control.cascade import TARGET_SIZE, CascadeGains, cascade, cascade_target
from np_drake.references.harmonic import circle
from np_drake.vehicle import Vehicle
from systems.cascaded_controller import CascadedController, FlatTarget
from systems.payload_config import PayloadConfig
from systems.tethered_quadrotor import make_tethered_quadrotor

VEHICLE = Vehicle()
X = np.array([0.1, 0, 1.0, 1, 0, 0, 0, 0, 0.2, 0, 0, 0, 0.1])


def target() -> np.ndarray:
    out = np.zeros(TARGET_SIZE)
    out[2] = 1.0
    return out


def fixed(dut):
    context = dut.CreateDefaultContext()
    dut.GetInputPort("x").FixValue(context, X)
    dut.GetInputPort("target").FixValue(context, target())
    return context


def test_forced_and_periodic_updates_are_the_pure_law():
    expected, integral = cascade(
        VEHICLE, CascadeGains(), x=X, target=target(), integral=np.zeros(6), step=0.0
    )
    dut = CascadedController(VEHICLE)
    forced, periodic = fixed(dut), fixed(dut)
    dut.update(forced)
    state = dut.EvalUniquePeriodicDiscreteUpdate(periodic).get_vector(0).CopyToVector()
    np.testing.assert_array_equal(dut.GetOutputPort("u").Eval(forced), expected)
    np.testing.assert_array_equal(state, [*expected, *integral, 0.0])


def test_the_integral_grows_by_the_time_since_the_last_update():
    dut = CascadedController(VEHICLE, period=None)
    context = fixed(dut)
    dut.update(context)
    context.SetTime(0.02)
    dut.update(context)
    integral = context.get_discrete_state(0).CopyToVector()[4:7]
    np.testing.assert_allclose(integral, [-0.1 * 0.02, 0, 0], atol=1e-12)


def test_in_a_diagram_it_brings_the_vehicle_to_the_target():
    builder = DiagramBuilder()
    real = builder.AddSystem(make_tethered_quadrotor(VEHICLE, PayloadConfig(tether="none")))
    dut = builder.AddNamedSystem("controller", CascadedController(VEHICLE))
    builder.Connect(real.GetOutputPort("x"), dut.GetInputPort("x"))
    builder.Connect(dut.GetOutputPort("u"), real.GetInputPort("u"))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    root = simulator.get_mutable_context()
    goal = target()
    goal[:3] = [0.5, -0.3, 0.4]
    dut.GetInputPort("target").FixValue(dut.GetMyMutableContextFromRoot(root), goal)
    simulator.AdvanceTo(12.0)
    x = real.GetOutputPort("x").Eval(real.GetMyContextFromRoot(root))
    assert x[:3] == pytest.approx(goal[:3], abs=0.02)  # [m]; the integral fades slowly


def test_a_nan_reading_holds_command_and_integral_until_the_next_good():
    vehicle = Vehicle()
    dut = CascadedController(vehicle)
    context = dut.CreateDefaultContext()
    x, target = np.zeros(13), np.zeros(TARGET_SIZE)
    x[3], target[2] = 1.0, 0.5
    dut.GetInputPort("target").FixValue(context, target)
    for t, reading in ((0.0, x), (0.01, x), (0.02, np.where(np.arange(13) == 11, np.nan, x))):
        context.SetTime(t)
        before = context.get_discrete_state(0).CopyToVector()
        dut.GetInputPort("x").FixValue(context, reading)
        dut.update(context)
    after = context.get_discrete_state(0).CopyToVector()
    np.testing.assert_array_equal(after[:10], before[:10])
    assert after[10] == 0.02  # the time without a reading is not integrated [s]
    context.SetTime(0.03)
    dut.GetInputPort("x").FixValue(context, x)
    dut.update(context)
    assert np.isfinite(context.get_discrete_state(0).CopyToVector()).all()


def test_the_target_is_that_of_the_reference_that_comes_in():
    dut, track = FlatTarget(VEHICLE), circle(radius=1.0, height=1.6, speed=1.5, ramp=2.0)
    context = dut.CreateDefaultContext()
    for t in (0.0, 0.57, 3.0):
        flat = track.sample(np.array([t]))
        dut.GetInputPort("flat").FixValue(context, flat.ravel())
        found, expected = (
            dut.GetOutputPort("target").Eval(context),
            cascade_target(VEHICLE, flat)[0],
        )
        np.testing.assert_array_equal(found, expected)
