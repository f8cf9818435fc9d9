"""The real vehicle at a random state under a random command."""

from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.multibody.math import SpatialVelocity

from np_drake import attitude
from np_drake.effects.base import Motion
from np_drake.rigid_body import residual_wrench
from np_drake.vehicle import Vehicle
from systems.tethered_quadrotor import PayloadConfig, make_tethered_quadrotor

VEHICLE = Vehicle()


def event(dut, context) -> None:
    """Run the periodic update once."""
    context.SetDiscreteState(dut.EvalUniquePeriodicDiscreteUpdate(context))


def evaluate(dut, context, name: str) -> np.ndarray:
    return dut.GetOutputPort(name).Eval(context)


def random_state(seed: int) -> np.ndarray:
    x = np.random.default_rng(seed).normal(scale=2.0, size=13)
    x[2] = abs(x[2]) + 0.1
    x[3:7] /= np.linalg.norm(x[3:7])
    return x


def in_flight(seed: int, **effects) -> SimpleNamespace:
    """The vehicle without payload at a random instant: everything true of it."""
    rng = np.random.default_rng(seed)
    dut = make_tethered_quadrotor(VEHICLE, PayloadConfig(tether="none"), **effects)
    context = dut.CreateDefaultContext()
    t, x, command = rng.uniform(0, 10), random_state(seed), rng.uniform(2.0, 9.0, 4)
    context.SetTime(t)
    plant = dut.GetSubsystemByName("plant")
    state = np.concatenate([x[3:7], x[:3], attitude.rotate(x[3:7], x[10:13]), x[7:10]])
    plant.SetPositionsAndVelocities(plant.GetMyMutableContextFromRoot(context), state)
    u = VEHICLE.mixer @ command
    dut.GetInputPort("u").FixValue(context, u)
    a, al = np.split(dut.GetOutputPort("acceleration").Eval(context), 2)
    thrust = dut.GetOutputPort("rotor_thrust").Eval(context)
    chi = residual_wrench(VEHICLE, q=x[3:7], w=x[10:13], a=a, al=al, u=u)
    np.testing.assert_allclose(dut.GetOutputPort("x").Eval(context), x, atol=1e-12)
    return SimpleNamespace(
        x=x, a=a, al=al, u=u, command=command, chi=chi, motion=Motion(t, x, thrust)
    )


@pytest.fixture
def apply_impulse():
    """Add dv = J / m to the payload of a cable: (plant, its context, J (3,) in W [N·s])."""

    def apply(plant, context, impulse):
        P = plant.GetBodyByName("payload")
        V = plant.EvalBodySpatialVelocityInWorld(context, P)
        dv = np.asarray(impulse, float) / P.get_mass(context)
        pushed = SpatialVelocity(V.rotational(), V.translational() + dv)
        plant.SetFreeBodySpatialVelocity(context=context, body=P, V_JpJc=pushed)

    return apply
