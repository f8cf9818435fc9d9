"""RotorPy's parameters in RotorPy: wrench of the rotors, and the flight of Drake again."""

import dataclasses as dc
import json
from typing import ClassVar

import numpy as np
import pytest

from diagrams.exports.rotorpy import rotorpy_parameters, write_rotorpy
from np_drake.effects.base import Motion, Parameter, WrenchEffect
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.combine import total_wrench
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mixer_gain import MixerGain
from np_drake.effects.quadratic_drag import QuadraticDrag
from np_drake.effects.rotor_inflow import RotorInflow
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.effects.translational_lift import TranslationalLift
from np_drake.vehicle import Vehicle

KEYS = {
    *("mass", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz", "num_rotors", "rotor_pos", "rotor_directions"),
    *("c_Dx", "c_Dy", "c_Dz", "k_eta", "k_m", "k_d", "k_z", "k_h", "k_flap"),
    *("tau_m", "rotor_speed_min", "rotor_speed_max", "motor_noise_std"),
}


@dc.dataclass(frozen=True)
class HubDrag(WrenchEffect):
    """RotorPy's rotor drag, f_i = -k omega_i diag(d) (v + w x r_i) at every rotor; own words for the test."""

    lateral: float = 0.3  # at hover rotor speed, as d_x of `linear_drag` [N·s/m]
    axial: float = 0.25  # [N·s/m]

    identifier: ClassVar[str] = "hub_drag"
    parameters: ClassVar[tuple[Parameter, ...]] = ()

    def wrench(self, vehicle, motion):
        share = np.sqrt(np.maximum(motion.rotor_thrust, 0.0) / (vehicle.mass * vehicle.gravity / 4)) / 4
        v_B, w, d = motion.R_WB.T @ motion.x[7:10], motion.x[10:13], [self.lateral, self.lateral, self.axial]
        places = np.array(vehicle.rotor_positions)
        f = [-s * np.array(d) * (v_B + np.cross(w, r)) for s, r in zip(share, places, strict=True)]
        return np.concatenate([motion.R_WB @ np.sum(f, axis=0), np.sum(np.cross(places, f), axis=0)])


def multirotor(parameters: dict, **given):
    module = pytest.importorskip(
        "rotorpy.vehicles.multirotor", reason="RotorPy is not installed: pip install 'np_drake[exports]'"
    )
    return module.Multirotor(parameters, control_abstraction="cmd_motor_speeds", **given)


def fly(flight) -> np.ndarray:
    """States (26, 13) of a gentle flight, by Runge-Kutta 4(5) with a relative tolerance of 1e-6 a command."""
    parameters = rotorpy_parameters(flight.vehicle, flight.effects)
    tolerances = {"method": "RK45", "rtol": 1e-6, "atol": 1e-9}
    dut = multirotor(parameters, integrator_kwargs=tolerances)
    zero = np.zeros(3)
    now = {"x": zero, "v": zero, "q": np.array([0, 0, 0, 1.0]), "w": zero, "wind": zero}
    now["rotor_speeds"] = flight.first_speed
    states = []
    for k in range(len(flight.u) + 1):
        if k % flight.rows == 0:
            states.append(np.concatenate([now["x"], now["q"][[3, 0, 1, 2]], now["v"], now["w"]]))
        if k < len(flight.u):
            now = dut.step(now, {"cmd_motor_speeds": flight.speeds[k]}, flight.period)
    return np.array(states)


def test_the_dictionary_has_every_key_that_rotorpy_reads():
    assert rotorpy_parameters(Vehicle(), []).keys() >= KEYS


def test_the_file_holds_the_dictionary(tmp_path):
    write_rotorpy(Vehicle(), [ThrustScale(0.9)], tmp_path / "dut.json")
    read, given = (json.loads((tmp_path / "dut.json").read_text()), rotorpy_parameters(Vehicle(), [ThrustScale(0.9)]))
    assert read.keys() == given.keys()
    assert read["k_eta"] == pytest.approx(0.9e-5)
    np.testing.assert_array_equal(read["rotor_pos"]["r2"], given["rotor_pos"]["r2"])
    np.testing.assert_array_equal(read["rotor_directions"], given["rotor_directions"])


def test_another_gravity_is_named(tmp_path):
    account = write_rotorpy(Vehicle(gravity=1.62), [], tmp_path / "dut.json")
    assert [(line.identifier, line.how) for line in account] == [("gravity", "left out")]


def test_rotors_have_the_torque_about_the_centre_of_mass():
    vehicle, gain, center = Vehicle(), MixerGain(0.7, 0.8, 0.9), np.array([0.01, -0.02, 0.03])
    dut = multirotor(rotorpy_parameters(vehicle, [gain, CenterOfMassOffset(*center)]))
    thrust = np.array([5.0, 4.0, 6.0, 3.0])
    force, torque = dut.compute_body_wrench(np.zeros(3), np.sqrt(thrust / vehicle.thrust_coefficient), np.zeros(3))
    u = vehicle.mixer @ thrust
    motion = Motion(0.0, np.array([0.0, 0, 0, 1, *np.zeros(9)]), thrust)
    about_origin = u[1:] + gain.wrench(vehicle, motion)[3:]
    np.testing.assert_allclose(force, [0, 0, u[0]], atol=1e-12)  # [N]
    np.testing.assert_allclose(torque, about_origin - np.cross(center, force), atol=1e-12)  # [N·m]


FLOW = {
    "linear_drag": (LinearDrag(0.3, 0.3, 0.25), [1.0, -2.0, 0.5]),
    "quadratic_drag": (QuadraticDrag(0.05, 0.06, 0.07), [0.0, -2.0, 0.0]),  # exact along one axis
    "translational_lift": (TranslationalLift(0.04), [1.0, -2.0, 0.5]),
    "blade_flapping": (BladeFlapping(0.03), [1.0, -2.0, 0.5]),
    "rotor_inflow": (RotorInflow(0.6), [0.0, 0.0, 1e-5]),  # exact to first order in climb
}


@pytest.mark.parametrize("name", FLOW)
def test_hovering_rotors_in_a_flow_have_the_wrench_of_the_effect(name):
    vehicle, scale = Vehicle(), ThrustScale(0.9)
    effect, v = FLOW[name]
    dut = multirotor(rotorpy_parameters(vehicle, [effect, scale]))
    thrust = np.full(4, vehicle.mass * vehicle.gravity / 4)
    speed = np.sqrt(thrust / (0.9 * vehicle.thrust_coefficient))
    still, moving = (dut.compute_body_wrench(np.zeros(3), speed, np.array(u)) for u in (np.zeros(3), v))
    x = np.array([0.0, 0, 0, 1, 0, 0, 0, *v, 0, 0, 0])
    chi = total_wrench(vehicle, [effect], Motion(0.0, x, thrust))
    size = np.abs(chi).max()
    np.testing.assert_allclose(np.subtract(moving, still).ravel(), chi, atol=1e-6 * size)  # [N, N·m]


# Position [m], attitude [rad]: a rotor without lag gets one of 1 ms, by which torque comes late. Drag compares with
# that at the hubs, which brakes turning too: then only the steps of Drake remain.
FLIGHTS = {
    "nominal": (2e-2, 1e-3),
    "exact": (2e-2, 1e-3),
    "lag": (2e-5, 1e-6),
    "drag": (2e-2, 1e-3),
    "all": (1e-4, 1e-6),
}


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_flight_in_rotorpy_is_that_in_drake(name, gentle):
    flight = gentle.Flight(gentle.effects[name])
    at_hubs = [HubDrag() if isinstance(e, LinearDrag) else e for e in flight.effects]
    expected = gentle.Flight(at_hubs)
    expected.u = flight.u
    expected = expected.drake()
    assert np.linalg.norm(expected[-1, :3]) > 5.0  # it flew [m]
    position, turn = gentle.furthest(fly(flight), expected)
    assert position < FLIGHTS[name][0]
    assert turn < FLIGHTS[name][1]
