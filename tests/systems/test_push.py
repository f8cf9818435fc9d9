"""Laws of the force from outside."""

import numpy as np
import pytest

from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig
from systems.tethered_quadrotor import make_tethered_quadrotor
from systems.wrench_effects import Push

VEHICLE = Vehicle()
BARE = PayloadConfig(tether="none")


def accelerated(payload, force):
    """Acceleration (3,) under a force on the hovering vehicle [m/s²]."""
    dut = make_tethered_quadrotor(VEHICLE, payload, pushed=True)
    context = dut.CreateDefaultContext()
    dut.GetInputPort("u").FixValue(context, VEHICLE.hover_input)
    push = dut.GetSubsystemByName("push")
    push.set_force(push.GetMyMutableContextFromRoot(context), np.array(force), np.zeros(3))
    return dut.GetOutputPort("acceleration").Eval(context)[:3]


def test_a_force_accelerates_the_vehicle_by_its_mass():
    force = [1.0, -2.0, 3.0]
    np.testing.assert_allclose(
        accelerated(BARE, force) - accelerated(BARE, np.zeros(3)),
        np.divide(force, VEHICLE.mass),
        atol=1e-9,
    )


def test_without_a_force_nothing_is_pushed():
    dut = Push(12, payload=True)
    assert not np.any(dut.get_output_port().Eval(dut.CreateDefaultContext()))


def test_each_force_stands_at_its_own_body():
    dut = Push(12, payload=True)
    context = dut.CreateDefaultContext()
    dut.set_force(context, np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]))
    expected = [0, 0, 0, 1, 2, 3, 0, 0, 0, 4, 5, 6]
    np.testing.assert_array_equal(dut.get_output_port().Eval(context), expected)


def test_two_contexts_do_not_influence_each_other():
    dut = Push(6, payload=False)
    one, other = dut.CreateDefaultContext(), dut.CreateDefaultContext()
    dut.set_force(one, np.ones(3), np.zeros(3))
    assert not np.any(dut.get_output_port().Eval(other))


def test_a_payload_that_there_is_not_cannot_be_pushed():
    dut = Push(6, payload=False)
    with pytest.raises(ValueError, match="payload"):
        dut.set_force(dut.CreateDefaultContext(), np.zeros(3), np.ones(3))
