import numpy as np

from np_drake.control.tracking_task import TrackingTask, observe
from np_drake.references.harmonic import circle
from systems.tracking_observation import TrackingObservation

TRACK, TASK = circle(radius=1.0, height=1.6, speed=1.5, ramp=2.0), TrackingTask(ahead=(0.2, 0.5))
X = np.array([0.1, 0, 1.0, 1, 0, 0, 0, 0, 0.2, 0, 0, 0, 0.1])


def test_it_is_the_pure_function_at_the_time_of_the_context():
    dut = TrackingObservation(TRACK, TASK)
    context = dut.CreateDefaultContext()
    dut.GetInputPort("x").FixValue(context, X)
    for t in (0.0, 1.3):
        context.SetTime(t)
        expected = observe(X, TRACK.sample(t + np.array([0.0, 0.2, 0.5])))
        np.testing.assert_array_equal(dut.GetOutputPort("observation").Eval(context), expected)
    assert dut.GetOutputPort("observation").size() == TASK.observation_size == 24
