"""Laws of the rate loop as a system."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop
from systems.rate_loop import RateLoopTorque


def test_it_passes_thrust_and_turns_by_the_loops_torque():
    vehicle = dc.replace(Vehicle(), rate_loop=RateLoop())
    dut = RateLoopTorque(vehicle)
    context = dut.CreateDefaultContext()
    x, command = np.eye(13)[3], np.array([21.0, 0.5, -0.2, 0.1])
    x[10:] = [0.3, 0.1, -0.4]
    dut.GetInputPort("x").FixValue(context, x)
    dut.GetInputPort("rates_thrust").FixValue(context, command)
    u = dut.get_output_port().Eval(context)
    assert u[0] == 21.0
    np.testing.assert_allclose(u[1:], RateLoop().torque(vehicle.J, x[10:], command[1:]))


def test_a_vehicle_without_a_loop_is_refused():
    with pytest.raises(ValueError, match="must have a rate_loop"):
        RateLoopTorque(Vehicle())
