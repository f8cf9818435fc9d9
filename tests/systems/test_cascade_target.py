import numpy as np

from np_drake.control.cascade import cascade_target
from np_drake.references.harmonic import circle
from np_drake.vehicle import Vehicle
from systems.cascaded_controller import FlatTarget

TRACK = circle(radius=1.0, height=1.6, speed=1.5, ramp=2.0)


def test_it_is_the_target_of_the_reference_that_comes_in():
    dut = FlatTarget(Vehicle())
    context = dut.CreateDefaultContext()
    for t in (0.0, 0.57, 3.0):
        flat = TRACK.sample(np.array([t]))
        dut.GetInputPort("flat").FixValue(context, flat.ravel())
        np.testing.assert_array_equal(
            dut.GetOutputPort("target").Eval(context), cascade_target(Vehicle(), flat)[0]
        )
