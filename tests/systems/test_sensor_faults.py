"""Laws of the sensor faults in a diagram, through their Context."""

import numpy as np
import pytest

from np_drake.control.faults import FrozenSamples, LateSamples, NanBurst
from systems.sensor_faults import SensorFaults

PERIOD = 0.02  # [s]
SPAN = {"onset": 0.2, "duration": 0.1, "sensor": "all"}
BEYOND = 1e-6  # time after an event at which the recorder reads [s]


def fix(dut, context, k):
    x = np.full(13, float(k))
    x[3:7] = [1.0, 0.0, 0.0, 0.0]
    for name, value in (("x", x), ("acceleration", np.full(6, k)), ("rotor_speed", np.full(4, k))):
        dut.GetInputPort(name).FixValue(context, np.asarray(value, float))


def height(dut, context):
    return float(dut.GetOutputPort("x").Eval(context)[2])


def run(dut, context, count=25):
    """Return the height that is read at every sample, and just after it."""
    read = []
    for k in range(count):
        context.SetTime(k * PERIOD)
        fix(dut, context, k)
        at = height(dut, context)
        state = dut.EvalUniquePeriodicDiscreteUpdate(context)
        context.get_mutable_discrete_state().SetFrom(state)
        context.SetTime(k * PERIOD + BEYOND)
        read.append((at, height(dut, context)))
    return read


def test_without_a_fault_the_reading_is_that_of_the_sensors():
    dut = SensorFaults([], period=PERIOD)
    assert run(dut, dut.CreateDefaultContext()) == [(k, k) for k in range(25)]


@pytest.mark.parametrize(
    ("fault", "source"),
    [(FrozenSamples(**SPAN), lambda k: 9), (LateSamples(**SPAN, samples=3), lambda k: k - 3)],
    ids=["frozen", "late"],
)
def test_controller_and_recorder_read_the_same_sample(fault, source):
    dut = SensorFaults([fault], period=PERIOD)
    expected = [source(k) if 10 <= k < 15 else k for k in range(25)]
    assert run(dut, dut.CreateDefaultContext()) == [(k, k) for k in expected]


def test_a_burst_of_nan_ends():
    dut = SensorFaults([NanBurst(**SPAN)], period=PERIOD)
    read = np.array(run(dut, dut.CreateDefaultContext()))
    assert np.flatnonzero(np.isnan(read[:, 0])).tolist() == [10, 11, 12, 13, 14]


def test_two_contexts_keep_their_own_samples():
    dut = SensorFaults([FrozenSamples(**SPAN)], period=PERIOD)
    one, other = dut.CreateDefaultContext(), dut.CreateDefaultContext()
    run(dut, one, 5)
    assert run(dut, other) == run(dut, dut.CreateDefaultContext())
    assert one.get_discrete_state(1).value()[0] == 4


def test_the_state_does_not_pull_accelerations():
    dut = SensorFaults([FrozenSamples(**SPAN)], period=PERIOD)
    context = dut.CreateDefaultContext()
    dut.GetInputPort("x").FixValue(context, np.arange(13.0))  # and nothing else
    assert height(dut, context) == 2.0
