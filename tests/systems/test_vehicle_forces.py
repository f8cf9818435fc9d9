"""Laws of the compiled forces: they are the sum of the single effects."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.effects.battery_sag import BatterySag
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.effects.uneven_lag import UnevenLag
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig
from systems.tethered_quadrotor import make_tethered_quadrotor
from systems.vehicle_forces import SteadyEffects

VEHICLE = Vehicle()
LAG, SCALE, DRAG = MotorLag(0.04), ThrustScale(0.9), LinearDrag(0.3, 0.2, 0.1)
PORTS = ("x", "acceleration", "rotor_thrust", "nominal_rotor_thrust")


def pair(payload, actuators=(), wrenches=(), first=LAG, **options):
    """Return the compiled vehicle and that of single effects, and their contexts."""
    unknown = type("Unknown", (type(first),), {})(*dc.astuple(first))
    vehicles = []
    for lag in (first, unknown):  # the same in a class that the compiled forces do not know
        vehicle = make_tethered_quadrotor(
            VEHICLE, payload, actuator_effects=[lag, *actuators], wrench_effects=wrenches, **options
        )
        vehicles.append((vehicle, vehicle.CreateDefaultContext()))
    assert vehicles[0][0].HasSubsystemNamed("vehicle_forces")
    assert not vehicles[1][0].HasSubsystemNamed("vehicle_forces")
    return vehicles


def place(dut, context, seed, *, drift=0.0):
    """Set a random state and command; quaternions drift off unit."""
    rng = np.random.default_rng(seed)
    plant = dut.GetSubsystemByName("plant")
    own = plant.GetMyMutableContextFromRoot(context)
    q, bodies = plant.GetPositions(own), plant.num_positions() // 7
    for k in range(bodies):
        turn = rng.normal(size=4)
        q[7 * k : 7 * k + 4] = (1 + drift) * turn / np.linalg.norm(turn)
        q[7 * k + 4 : 7 * k + 7] = rng.normal(size=3) * 0.05 - [0, 0, 0.8 * k]
    plant.SetPositions(own, q)
    plant.SetVelocities(own, rng.normal(size=plant.num_velocities()))
    thrust = rng.uniform(1.0, 9.0, 4)
    if dut.HasSubsystemNamed("actuators"):
        actuators = dut.GetSubsystemByName("actuators")
        actuators.rest_at(actuators.GetMyMutableContextFromRoot(context), thrust)
    dut.GetInputPort("u").FixValue(context, VEHICLE.mixer @ rng.uniform(1.0, 9.0, 4))


def check_alike(vehicles, names, seed, *, drift=0.0):
    """Check that both have the same outputs and rates of the state."""
    found = []
    for dut, context in vehicles:
        place(dut, context, seed, drift=drift)
        outputs = [dut.GetOutputPort(name).Eval(context) for name in names]
        rates = dut.EvalTimeDerivatives(context).CopyToVector()
        found.append(np.concatenate([*outputs, rates]))
    # round-off of the sums
    np.testing.assert_allclose(found[0], found[1], rtol=1e-11, atol=1e-10)


@pytest.mark.parametrize(
    "payload", [PayloadConfig(), PayloadConfig(tether="none")], ids=["cable", "none"]
)
@pytest.mark.parametrize(
    "actuators",
    [(), (SCALE, WeakRotor(2, 0.8)), (SCALE, CommandDelay(0.013))],
    ids=["lag", "gains", "delay"],
)
@pytest.mark.parametrize(
    "wrenches",
    [
        (),
        (DRAG, LinearDrag(0.1, 0.1, 0.4)),
        (DRAG, ConstantWind(1.0, -2.0, 0.5)),
        (DRAG, RotorGyroscopic(2e-4), BladeFlapping(0.02)),
    ],
    ids=["none", "drags", "wind", "others"],
)
def test_the_compiled_forces_are_the_sum_of_the_single_effects(payload, actuators, wrenches):
    vehicles = pair(payload, actuators, wrenches)
    names = (*PORTS, "tether_wrench") if payload.tether == "cable" else PORTS
    for seed in range(4):
        check_alike(vehicles, names, seed, drift=1e-4 * seed)


@pytest.mark.parametrize("first", [SCALE, UnevenLag(0.03, 0.05)], ids=["none", "uneven"])
def test_rotors_with_another_lag_or_none_give_the_same(first):
    wrenches = (DRAG, RotorGyroscopic(2e-4))
    vehicles = pair(PayloadConfig(), (WeakRotor(2, 0.8),), wrenches, first)
    check_alike(vehicles, PORTS, 1)


@pytest.mark.parametrize(
    "actuators, wrenches, onsets",
    [
        ([LAG, BatterySag(0.95)], [DRAG], {}),
        ([SCALE, LAG], [DRAG], {}),
        ([LAG, SCALE], [DRAG], {DRAG: 2.0}),
    ],
    ids=["sag", "scale first", "onset"],
)
def test_what_is_not_steady_has_no_compiled_form(actuators, wrenches, onsets):
    assert SteadyEffects.of(VEHICLE, actuators, wrenches, onsets) is None
    names = {"actuator_effects": actuators, "wrench_effects": wrenches, "onsets": onsets}
    assert not make_tethered_quadrotor(VEHICLE, PayloadConfig(), **names).HasSubsystemNamed(
        "vehicle_forces"
    )
