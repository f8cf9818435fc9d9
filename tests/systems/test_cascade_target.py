import numpy as np

from np_drake.control.cascade import cascade_target
from np_drake.references.harmonic import circle
from np_drake.vehicle import Vehicle
from systems.cascade_target import CascadeTarget

TRACK, PERIOD, END = circle(radius=1.0, height=1.6, speed=1.5, ramp=2.0), 0.01, 3.0


def target_at(t: float) -> np.ndarray:
    dut = CascadeTarget(Vehicle(), TRACK, period=PERIOD, end=END)
    context = dut.CreateDefaultContext()
    context.SetTime(t)
    return dut.GetOutputPort("target").Eval(context)


def test_at_every_multiple_of_the_period_it_is_the_target_of_that_time():
    for k in (0, 29, 57, 300):
        t = k * PERIOD
        expected = cascade_target(Vehicle(), TRACK.sample(np.array([t])))[0]
        np.testing.assert_allclose(target_at(t), expected, atol=1e-12)  # rounding


def test_between_two_multiples_it_is_the_earlier_one():
    np.testing.assert_array_equal(target_at(0.578), target_at(0.57))


def test_after_the_end_it_rests():
    np.testing.assert_array_equal(target_at(END + 5.0), target_at(END))
