import numpy as np

from np_drake.control.cascade import TARGET_SIZE, CascadeGains, cascade, cascade_target
from np_drake.references.harmonic import circle
from np_drake.vehicle import Vehicle
from systems.cascaded_controller import CascadedController, FlatTarget

VEHICLE = Vehicle()
X = np.array([0.1, 0, 1.0, 1, 0, 0, 0, 0, 0.2, 0, 0, 0, 0.1])
TARGET = np.eye(TARGET_SIZE)[2]


def fixed(dut):
    context = dut.CreateDefaultContext()
    dut.GetInputPort("x").FixValue(context, X)
    dut.GetInputPort("target").FixValue(context, TARGET)
    return context


def update(dut, context):
    state = dut.EvalUniquePeriodicDiscreteUpdate(context).get_vector(0).CopyToVector()
    context.SetDiscreteState(0, state)


def test_the_command_is_that_of_the_pure_law():
    expected, integral = cascade(
        VEHICLE, CascadeGains(), x=X, target=TARGET, integral=np.zeros(6), step=0.0
    )
    dut = CascadedController(VEHICLE, period=0.01)
    context = fixed(dut)
    update(dut, context)
    np.testing.assert_array_equal(dut.GetOutputPort("u").Eval(context), expected)
    state = context.get_discrete_state(0).CopyToVector()
    np.testing.assert_array_equal(state, [*expected, *integral, 0.0])


def test_a_nan_reading_holds_command_and_integral_until_the_next_good():
    dut = CascadedController(VEHICLE, period=0.01)
    context = dut.CreateDefaultContext()
    x, target = np.zeros(13), np.zeros(TARGET_SIZE)
    x[3], target[2] = 1.0, 0.5
    dut.GetInputPort("target").FixValue(context, target)
    for t, reading in ((0.0, x), (0.01, x), (0.02, np.where(np.arange(13) == 11, np.nan, x))):
        context.SetTime(t)
        before = context.get_discrete_state(0).CopyToVector()
        dut.GetInputPort("x").FixValue(context, reading)
        update(dut, context)
    after = context.get_discrete_state(0).CopyToVector()
    np.testing.assert_array_equal(after[:10], before[:10])
    assert after[10] == 0.02  # the time without a reading is not integrated [s]
    context.SetTime(0.03)
    dut.GetInputPort("x").FixValue(context, x)
    update(dut, context)
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
