"""MJCF files in MuJoCo: mass, rotors, drag and payload, and the flight of Drake again."""

import numpy as np
import pytest

from diagrams.exports.corrected import corrected
from diagrams.exports.formats import write_mujoco
from diagrams.gap.drake_replay import Commands, Rollout, Swing
from np_drake import effects as fx
from np_drake.effects.base import Motion
from np_drake.effects.combine import mass_properties
from np_drake.vehicle.vehicle import Vehicle, load_vehicle, preset_names
from systems.plant import spatial_inertia

mujoco = pytest.importorskip(
    "mujoco", reason="MuJoCo is not installed: pip install 'np_drake[exports]'"
)


PERIOD, ROWS = 0.01, 20  # of a command [s]; commands between compared states


def model(vehicle, effects, folder):
    """MuJoCo's model of the exported file, and its data in the keyframe `hover`."""
    write_mujoco(vehicle, effects, folder / "dut.xml")
    dut = mujoco.MjModel.from_xml_path(str(folder / "dut.xml"))
    data = mujoco.MjData(dut)
    mujoco.mj_resetDataKeyframe(dut, data, 0)
    mujoco.mj_forward(dut, data)
    return dut, data


@pytest.mark.parametrize("preset", preset_names())
def test_the_body_has_the_corrected_mass_properties(preset, tmp_path):
    vehicle = load_vehicle(preset)
    offset = fx.CenterOfMassOffset(0.1 * np.abs(vehicle.rotor_positions).max(), 0, 0)
    effects = [fx.MassError(0.07 * vehicle.mass), fx.InertiaError(1.2, 0.9, 1.1), offset]
    dut, data = model(vehicle, effects, tmp_path)
    full = np.zeros((6, 6))
    for unit, column in zip(np.eye(6), full, strict=True):
        mujoco.mj_mulM(dut, data, column, unit)
    matrix = spatial_inertia(mass_properties(vehicle, effects)).CopyToFullMatrix6()
    turned = np.roll(matrix, 3, axis=(0, 1))  # [translation, rotation]
    # MuJoCo turns J to its principal axes.
    np.testing.assert_allclose(full, turned, atol=1e-9 * vehicle.mass)


def test_motors_have_the_wrench_of_mixer_and_weak_rotor(tmp_path):
    vehicle, gain, weak = Vehicle(), fx.MixerGain(0.7, 0.8, 0.9), fx.WeakRotor(2, 0.6)
    dut, data = model(vehicle, [gain, weak], tmp_path)
    command = np.array([5.0, 4.0, 6.0, 13.0])  # the last beyond the largest thrust [N]
    data.ctrl[:4] = command
    mujoco.mj_forward(dut, data)
    thrust = weak.thrust(vehicle, np.zeros(0), np.minimum(command, vehicle.max_rotor_thrust))
    u = vehicle.mixer @ thrust
    motion = Motion(0.0, np.array([0.0, 0, 0, 1, *np.zeros(9)]), thrust)
    expected = np.concatenate([[0, 0, u[0]], u[1:] + gain.wrench(vehicle, motion)[3:]])
    np.testing.assert_allclose(data.qfrc_actuator[:6], expected, atol=1e-12)  # [N, N·m]


def test_delayed_motors_answer_after_their_delay(tmp_path):
    dut, data = model(Vehicle(), [fx.CommandDelay(0.05)], tmp_path)
    data.ctrl[:4] = 5.0
    answers = []
    for _ in range(40):
        mujoco.mj_step(dut, data)
        answers.append((data.time, data.actuator_force[0]))
    answered = next(time for time, force in answers if force > 0)
    assert abs(answered - 0.05) <= 2 * dut.opt.timestep  # [s]
    assert answers[-1][1] == 5.0


class GentleFlight:
    """5 s open loop near hover, swaying by 0.1 to 0.2 rad; Drake's own error is 1e-6 m."""

    def __init__(self, effects):
        self.vehicle, self.effects = Vehicle(), effects
        c = self.corrected = corrected(self.vehicle, effects)
        t = self.t = np.arange(0.0, 5.0 - 1e-9, PERIOD)
        thrust = 4 * c.hover_thrust / c.scale * (1.0 + 0.04 * np.sin(2.1 * t))
        roll, pitch = 0.008 * np.cos(2.5 * t), 0.01 * np.cos(3.0 * t)
        if c.payload is not None:  # a hook in front pulls the nose down
            pitch = pitch - c.payload.hook_x * c.payload.mass * self.vehicle.gravity
        self.u = np.stack([thrust, roll, pitch, 0.004 * np.cos(1.3 * t)], axis=1)

    def drake(self):
        """States (25, 13) of the flight in Drake, every 0.2 s."""
        start, hung = np.eye(16)[3, :13], self.corrected.payload
        swing = Swing(np.array([0, 0, -hung.length]), np.zeros(3), np.zeros(3)) if hung else None
        times = np.arange(0.0, 5.0 + 1e-9, ROWS * PERIOD)
        dut = Rollout(self.vehicle, self.effects)
        return dut.fly(start, Commands(self.t, self.u), times, swing)[:, :13]


EFFECTS = {
    "exact": [fx.ThrustScale(0.93), fx.MassError(0.15), fx.InertiaError(1.2, 0.9, 1.1)],
    "lag": [fx.MotorLag(0.04)],
    "drag": [fx.LinearDrag(0.3, 0.3, 0.25)],
    "payload": [fx.SuspendedPayload(0.26, 0.8, 0.02, 0.0, -0.05, damping=0.05)],
}
# Position [m], attitude [rad]. exact: Drake's steps. lag: a lag of thrust differs from one of speed
# by the square of the change of speed. drag: constant rotor speed is wrong by the 2 % of its sway.
# payload: Drake's cable stretches by 0.13 mm.
FLIGHTS = {"exact": (1e-6, 1e-7), "lag": (4e-2, 2e-3)}
FLIGHTS |= {"drag": (5e-3, 1e-7), "payload": (2e-3, 1e-4)}


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_flight_in_mujoco_is_that_in_drake(name, tmp_path):
    flight = GentleFlight(EFFECTS[name])
    dut, data = model(flight.vehicle, flight.effects, tmp_path)
    if dut.na:
        data.act[:] = flight.corrected.hover_thrust
    steps, states = round(PERIOD / dut.opt.timestep), []
    for k, thrusts in enumerate(flight.u @ flight.vehicle.unmixer.T):
        data.ctrl[:4] = thrusts
        mujoco.mj_step(dut, data, steps)
        if (k + 1) % ROWS == 0:  # a free joint has [p, q (w, x, y, z)] and [v in W, w in B]
            states.append(np.concatenate([data.qpos[:7], data.qvel[:6]]))
    expected = flight.drake()
    assert np.linalg.norm(expected[-1, :3]) > 5.0  # it flew [m]
    off = np.array(states) - expected
    position, turn = FLIGHTS[name]
    assert np.linalg.norm(off[:, :3], axis=1).max() < position
    assert 2 * np.linalg.norm(off[:, 3:7], axis=1).max() < turn
