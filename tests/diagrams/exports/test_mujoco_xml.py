"""MJCF files in MuJoCo: mass, rotors, drag and payload, and the flight of Drake again."""

import dataclasses as dc
from typing import ClassVar

import numpy as np
import pytest

from diagrams.exports.mujoco_xml import write_mujoco
from np_drake import attitude
from np_drake.effects.base import ActuatorEffect, Motion, Parameter, WrenchEffect
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.combine import mass_properties
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.mixer_gain import MixerGain
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.vehicle.vehicle import Vehicle, load_vehicle, preset_names
from systems.plant import spatial_inertia

mujoco = pytest.importorskip(
    "mujoco", reason="MuJoCo is not installed: pip install 'np_drake[exports]'"
)


@dc.dataclass(frozen=True)
class ThrustLag(ActuatorEffect):
    """What the export makes of a motor lag: a lag of thrust."""

    time_constant: float = 0.04  # [s]

    identifier: ClassVar[str] = "thrust_lag"
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    state_size: ClassVar[int] = 4

    def state_at(self, vehicle, thrust):
        return np.array(thrust)

    def state_rate(self, vehicle, state, command):
        return (command - state) / self.time_constant

    def thrust(self, vehicle, state, command, t=0.0):
        return state


@dc.dataclass(frozen=True)
class SteadyDrag(WrenchEffect):
    """What the export makes of a linear drag: that of constant rotor speed."""

    d_x: float = 0.3  # [N·s/m]
    d_y: float = 0.3
    d_z: float = 0.25

    identifier: ClassVar[str] = "steady_drag"
    parameters: ClassVar[tuple[Parameter, ...]] = ()

    def wrench(self, vehicle, motion):
        f_B = -np.array([self.d_x, self.d_y, self.d_z]) * (motion.R_WB.T @ motion.x[7:10])
        return np.concatenate([motion.R_WB @ f_B, np.zeros(3)])


def model(vehicle, effects, folder):
    """MuJoCo's model of the exported file, and its data in the keyframe `hover`."""
    write_mujoco(vehicle, effects, folder / "dut.xml")
    dut = mujoco.MjModel.from_xml_path(str(folder / "dut.xml"))
    data = mujoco.MjData(dut)
    mujoco.mj_resetDataKeyframe(dut, data, 0)
    mujoco.mj_forward(dut, data)
    return dut, data


def fly(flight, folder) -> np.ndarray:
    """States (26, 13) of a gentle flight; a free joint has [p, q (w, x, y, z)] and [v in W, w in
    B].
    """
    dut, data = model(flight.vehicle, flight.effects, folder)
    if dut.na:
        data.act[:] = flight.corrected.hover_thrust
    steps, states = round(flight.period / dut.opt.timestep), []
    for k in range(len(flight.u) + 1):
        if k % flight.rows == 0:
            states.append(np.concatenate([data.qpos[:7], data.qvel[:6]]))
        if k < len(flight.u):
            data.ctrl[:4] = flight.thrusts[k]
            mujoco.mj_step(dut, data, steps)
    return np.array(states)


@pytest.mark.parametrize("preset", preset_names())
def test_the_body_has_the_corrected_mass_properties(preset, tmp_path):
    vehicle = load_vehicle(preset)
    arm = np.abs(vehicle.rotor_positions).max()
    effects = [
        MassError(0.07 * vehicle.mass),
        InertiaError(1.2, 0.9, 1.1),
        CenterOfMassOffset(0.1 * arm, 0, 0),
    ]
    dut, data = model(vehicle, effects, tmp_path)
    full = np.zeros((6, 6))
    for unit, column in zip(np.eye(6), full, strict=True):
        mujoco.mj_mulM(dut, data, column, unit)
    matrix = spatial_inertia(
        mass_properties(vehicle, effects)
    ).CopyToFullMatrix6()  # [rotation, translation]
    turned = np.block([[matrix[3:, 3:], matrix[3:, :3]], [matrix[:3, 3:], matrix[:3, :3]]])
    np.testing.assert_allclose(
        full, turned, atol=1e-9 * vehicle.mass
    )  # MuJoCo turns J to its principal axes


def test_a_vehicle_hovers_in_the_keyframe(tmp_path):
    effects = [
        *(WeakRotor(3, 0.8), MotorLag(0.03), MassError(0.2)),
        *(ThrustScale(0.9), SuspendedPayload(mass=0.2, length=0.6)),
    ]
    dut, data = model(Vehicle(), effects, tmp_path)
    mujoco.mj_step(dut, data, 250)
    assert (
        np.abs(data.qpos[:3]).max() < 2e-4
    )  # after 0.5 s; the tether yields by 0.02 mm before it pulls [m]
    assert np.abs(data.qacc[:9]).max() < 1e-3  # [m/s²]


def test_motors_have_the_wrench_of_mixer_and_weak_rotor(tmp_path):
    vehicle, gain, weak = Vehicle(), MixerGain(0.7, 0.8, 0.9), WeakRotor(2, 0.6)
    dut, data = model(vehicle, [gain, weak], tmp_path)
    command = np.array([5.0, 4.0, 6.0, 13.0])  # the last beyond the largest thrust [N]
    data.ctrl[:4] = command
    mujoco.mj_forward(dut, data)
    thrust = weak.thrust(vehicle, np.zeros(0), np.minimum(command, vehicle.max_rotor_thrust))
    u = vehicle.mixer @ thrust
    motion = Motion(0.0, np.array([0.0, 0, 0, 1, *np.zeros(9)]), thrust)
    expected = np.concatenate([[0, 0, u[0]], u[1:] + gain.wrench(vehicle, motion)[3:]])
    np.testing.assert_allclose(data.qfrc_actuator[:6], expected, atol=1e-12)  # [N, N·m]


def test_drag_actuators_have_the_force_of_the_effect_in_hover(tmp_path):
    vehicle, drag = Vehicle(), LinearDrag(0.3, 0.2, 0.25)
    dut, data = model(vehicle, [drag, MassError(0.2)], tmp_path)
    q, v = (
        attitude.from_rotation_vector(np.array([[0.3, -0.5, 0.8]]))[0],
        np.array([1.0, -2.0, 0.5]),
    )
    data.qpos[3:7], data.qvel[:6] = q, [*v, 0.3, 0.4, -0.2]
    data.ctrl[:] = 0.0
    mujoco.mj_forward(dut, data)
    x = np.concatenate([np.zeros(3), q, v, [0.3, 0.4, -0.2]])
    chi = drag.wrench(vehicle, Motion(0.0, x, np.full(4, 2.2 * vehicle.gravity / 4)))
    np.testing.assert_allclose(data.qfrc_actuator[:6], chi, atol=1e-12)  # [N, N·m]


def test_delayed_motors_answer_after_their_delay(tmp_path):
    dut, data = model(Vehicle(), [CommandDelay(0.05)], tmp_path)
    data.ctrl[:4] = 5.0
    answers = []
    for _ in range(40):
        mujoco.mj_step(dut, data)
        answers.append((data.time, data.actuator_force[0]))
    answered = next(time for time, force in answers if force > 0)
    assert abs(answered - 0.05) <= 2 * dut.opt.timestep  # [s]
    assert answers[-1][1] == 5.0


def test_the_tether_pulls_and_never_pushes(tmp_path):
    payload = SuspendedPayload(mass=0.3, length=0.7, hook_x=0.02, hook_z=-0.05)
    dut, data = model(Vehicle(), [payload], tmp_path)
    data.qpos[9] -= 1e-4  # the payload is lowered
    mujoco.mj_forward(dut, data)
    assert data.qacc[8] > 0.0
    data.qpos[9] += 0.3  # and lifted
    data.ctrl[:4] = 0.0
    mujoco.mj_forward(dut, data)
    np.testing.assert_allclose(data.qacc[6:9], [0, 0, -9.81], atol=1e-9)  # it falls freely [m/s²]


# Position [m], attitude [rad]. nominal, exact: Drake's steps. lag: a lag of thrust differs from one
# of speed by the square of the change of speed, 4 % in the first instant of `all`; torque,
# integrated openly, makes some 0.5 % of the way of it. drag: constant rotor speed is wrong by the 2
# % of its sway. payload: Drake's cable stretches by 0.13 mm.
FLIGHTS = {
    "nominal": (1e-6, 1e-7),
    "exact": (1e-6, 1e-7),
    "lag": (4e-2, 2e-3),
    "drag": (5e-3, 1e-7),
    "all": (1e-1, 3e-3),
    "payload": (2e-3, 1e-4),
}


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_flight_in_mujoco_is_that_in_drake(name, gentle, tmp_path):
    flight = gentle.Flight(gentle.effects[name])
    expected = flight.drake()
    assert np.linalg.norm(expected[-1, :3]) > 5.0  # it flew [m]
    position, turn = gentle.furthest(fly(flight, tmp_path), expected)
    assert position < FLIGHTS[name][0]
    assert turn < FLIGHTS[name][1]


def test_nothing_but_what_the_account_names_is_approximate(gentle, tmp_path):
    flight = gentle.Flight(gentle.effects["all"])
    stand_ins = {
        MotorLag: ThrustLag(flight.corrected.time_constant),
        LinearDrag: SteadyDrag(*flight.corrected.drag_in_hover),
    }
    named = gentle.Flight([stand_ins.get(type(effect), effect) for effect in flight.effects])
    named.u = flight.u
    position, turn = gentle.furthest(fly(flight, tmp_path), named.drake())
    assert position < 1e-4  # Drake's steps of 10 ms on a lag of 40 ms [m]
    assert turn < 1e-5  # [rad]


def test_the_flight_feels_every_effect_of_the_export(gentle, tmp_path):
    flight = gentle.Flight(gentle.effects["all"])
    expected = flight.drake()
    for left_out in flight.effects:
        other = gentle.Flight([e for e in flight.effects if e is not left_out])
        other.u = flight.u
        assert gentle.furthest(fly(other, tmp_path), expected)[0] > FLIGHTS["all"][0]
