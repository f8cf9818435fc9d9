"""What Drake's plant does under an effect is what the effect's pure function says."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake import attitude
from np_drake.effects.base import ActuatorEffect, MassEffect, WrenchEffect
from np_drake.effects.combine import mass_properties, total_wrench
from np_drake.effects.downwash import Downwash
from np_drake.effects.library import LIBRARY
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.quadratic_drag import QuadraticDrag
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.flight_log import Neighbour
from np_drake.vehicle import Vehicle
from systems.plant import set_hover
from systems.tethered_quadrotor import PayloadConfig, make_tethered_quadrotor
from tests.systems.conftest import in_flight as fly

VEHICLE = Vehicle()
SEEDS = pytest.mark.parametrize("seed", [0, 1])


def every(base):
    found = [e for e in LIBRARY.values() if issubclass(e, base) and e is not SuspendedPayload]
    return pytest.mark.parametrize("effect", found, ids=[e.identifier for e in found])


@SEEDS
@every(WrenchEffect)
def test_the_plant_feels_the_wrench_of_the_pure_function(effect, seed):
    effects = [effect(), LinearDrag(0.1, 0.2, 0.3), QuadraticDrag(0.01, 0.02, 0.03)]
    now = fly(seed, wrench_effects=effects)
    np.testing.assert_allclose(now.chi, total_wrench(VEHICLE, effects, now.motion), atol=1e-9)
    drags = total_wrench(VEHICLE, effects[1:], now.motion)
    acts = np.abs(now.chi - drags).max() > 1e-4
    assert acts or isinstance(effect(), LinearDrag)


@SEEDS
@every(ActuatorEffect)
def test_the_plant_feels_the_thrust_of_the_pure_function(effect, seed):
    dut = effect()
    now = fly(seed, actuator_effects=[dut])
    hover = np.full(4, VEHICLE.mass * VEHICLE.gravity / 4)
    seen = hover if dut.dead_time else now.command  # what was commanded before the start
    thrust = dut.thrust(VEHICLE, dut.state_at(VEHICLE, hover), seen, now.motion.t)
    np.testing.assert_allclose(now.motion.rotor_thrust, thrust, atol=1e-12)
    wrong = VEHICLE.mixer @ (thrust - now.command)
    np.testing.assert_allclose(now.chi[:3], wrong[0] * attitude.body_z(now.x[3:7]), atol=1e-9)
    np.testing.assert_allclose(now.chi[3:], wrong[1:], atol=1e-9)
    assert np.abs(wrong).max() > 1e-3


@SEEDS
def test_rotors_that_lag_turn_the_body_by_their_own_angular_momentum(seed):
    lag, spin = MotorLag(0.05), RotorGyroscopic(2e-4)
    now = fly(seed, actuator_effects=[lag, ThrustScale(0.9)], wrench_effects=[spin])
    hover = np.full(4, VEHICLE.mass * VEHICLE.gravity / 4)
    rate = lag.state_rate(VEHICLE, lag.state_at(VEHICLE, hover), now.command)
    assert np.abs(rate).max() > 100.0
    motion = dc.replace(now.motion, rotor_rate=rate)
    wrong = VEHICLE.mixer @ (now.motion.rotor_thrust - now.command)
    np.testing.assert_allclose(now.chi[3:] - wrong[1:], spin.wrench(VEHICLE, motion)[3:], atol=1e-9)


@SEEDS
def test_weak_blades_leave_the_rotors_their_momentum(seed):
    spin = RotorGyroscopic(2e-4)
    now = fly(seed, actuator_effects=[ThrustScale(0.5)], wrench_effects=[spin])
    np.testing.assert_allclose(now.motion.rotor_thrust, 0.5 * now.command, atol=1e-12)
    turning = spin.wrench(VEHICLE, dc.replace(now.motion, nominal_thrust=now.command))[3:]
    assert np.abs(turning).max() > 1e-4
    missing = VEHICLE.mixer @ (now.motion.rotor_thrust - now.command)
    np.testing.assert_allclose(now.chi[3:] - missing[1:], turning, atol=1e-9)


@SEEDS
@every(MassEffect)
def test_the_plant_obeys_newton_and_euler_about_its_true_centre_of_mass(effect, seed):
    now = fly(seed, mass_effects=[effect()])
    assert np.abs(now.chi).max() > 1e-3
    _follows_newton_and_euler(now, mass_properties(VEHICLE, [effect()]))


def _follows_newton_and_euler(now, true, chi=np.zeros(6)):  # noqa: B008
    q, w, c, J = now.x[3:7], now.x[10:13], true.p_BoBcm_B, true.J
    a_cm = now.a + attitude.rotate(q, np.cross(now.al, c) + np.cross(w, np.cross(w, c)))
    F_W = now.u[0] * attitude.body_z(q) + chi[:3]
    np.testing.assert_allclose(true.mass * (a_cm + [0, 0, VEHICLE.gravity]), F_W, atol=1e-9)
    tau_Bcm = now.u[1:] + chi[3:] - np.cross(c, attitude.rotate_back(q, F_W))
    np.testing.assert_allclose(J @ now.al + np.cross(w, J @ w), tau_Bcm, atol=1e-9)


@pytest.mark.parametrize("tether", ["cable", "rod", "none"])
def test_neutral_effects_leave_the_hovering_vehicle_alone(tether):
    payload = PayloadConfig(tether=tether)
    neutral = {
        f"{base.place}_effects": [
            e.neutral()
            for e in LIBRARY.values()
            if issubclass(e, base) and e is not SuspendedPayload
        ]
        for base in (WrenchEffect, ActuatorEffect, MassEffect)
    }
    dut = make_tethered_quadrotor(VEHICLE, payload, **neutral)
    context = dut.CreateDefaultContext()
    plant = dut.GetSubsystemByName("plant")
    set_hover(plant, plant.GetMyMutableContextFromRoot(context), payload, [0, 0, 1.0])
    carried = VEHICLE.mass + (payload.mass if tether != "none" else 0.0)
    dut.GetInputPort("u").FixValue(context, [carried * VEHICLE.gravity, 0, 0, 0])
    np.testing.assert_allclose(dut.GetOutputPort("acceleration").Eval(context), 0.0, atol=1e-9)
    assert not dut.HasSubsystemNamed("actuators")


def test_a_downwash_acts_in_the_plant_and_is_refused_without_a_neighbour():
    above = Neighbour(np.array([0.0, 100.0]), np.tile([0.0, 0.0, 10.0], (2, 1)))
    now = fly(0, wrench_effects=[Downwash(1.0, (above,))])
    np.testing.assert_allclose(
        now.chi, Downwash(1.0, (above,)).wrench(VEHICLE, now.motion), atol=1e-9
    )
    assert now.chi[2] < 0.0
    with pytest.raises(
        ValueError, match=r"effects: downwash must have the path of a neighbour; Downwash\.near"
    ):
        make_tethered_quadrotor(
            VEHICLE, PayloadConfig(tether="none"), wrench_effects=[Downwash(1.0)]
        )
