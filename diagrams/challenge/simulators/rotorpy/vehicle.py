"""rotorpy's multirotor with a challenge's vehicle and effects in it."""

import math
from collections.abc import Sequence

import numpy as np
from rotorpy.vehicles.multirotor import Multirotor

from diagrams.challenge.simulators.rotorpy import library_effects
from diagrams.challenge.simulators.rotorpy.library_effects import ActiveEffect, Instant, cross, cushion
from diagrams.challenge.simulators.rotorpy.out_of_library import (
    actuators,
    aerodynamic,
    contact,
    ground_and_walls,
    wind,
)
from diagrams.challenge.simulators.rotorpy.own_physics import own_physics
from diagrams.challenge.simulators.rotorpy.tether import Tether
from diagrams.challenge.simulators.rotorpy.wind import winds
from np_drake import attitude
from np_drake.vehicle import Vehicle

X, V, Q, W, WIND, SPEED = (slice(*ends) for ends in ((0, 3), (3, 6), (6, 10), (10, 13), (13, 16), (16, 20)))
LAWS = (
    library_effects.LAWS
    | aerodynamic.LAWS
    | wind.LAWS
    | ground_and_walls.LAWS
    | contact.LAWS
    | actuators.LAWS
)
GAINS = library_effects.GAINS | actuators.GAINS
STATEFUL = aerodynamic.STATEFUL | contact.STATEFUL | actuators.STATEFUL
SIZE = 20  # of rotorpy's own state; hidden states follow


class RealMultirotor(Multirotor):
    """A multirotor of rotorpy: its rigid body, rotors, motor lag and wind state; other effects join its body wrench.

    rotorpy's own parameters are mass, inertia, place of the rotors from the centre of mass, thrust and torque
    coefficient (`thrust_scale`), motor time constant (infinite: none, and the command is the speed) and gravity. Its
    ground plane is off. `center`: p_BoBcm_B [m].   `dead_time`: of commands [s].

    Args: own: whether rotorpy's own aerodynamics act, and its own motor lag where neither effect nor file has one.
    """

    def __init__(self, vehicle: Vehicle, acting: Sequence[ActiveEffect], *, own: bool = False):
        physics = own_physics() if own else {}
        given = parameters(vehicle, acting, tau_m=physics.get("tau_m", np.inf))
        super().__init__(physics | given, aero=own, enable_ground=False)
        self.g = vehicle.gravity
        self.weight = np.array([0.0, 0.0, -self.mass * self.g])
        self.vehicle, self.center = vehicle, center_of_mass(acting)
        self._beside = bool(np.any(self.center))
        self.dead_time = sum(a.values["delay"] for a in acting if a.name == "command_delay")
        self._winds = winds(list(acting))
        self._laws = [(LAWS[a.name], a.values) for a in acting if a.name in LAWS]
        self._gains = [(GAINS[a.name], a.values) for a in acting if a.name in GAINS]
        self._ground = [a.values for a in acting if a.name == "ground_effect"]
        self._hidden = [STATEFUL[a.name](vehicle, a.values) for a in acting if a.name in STATEFUL]
        self._tether = next((Tether(a.values) for a in acting if a.name == "suspended_payload"), None)
        self._plain = not (self._laws or self._gains or self._ground or self._hidden or self._tether)
        self._t, self._s, self._command = 0.0, np.zeros(SIZE), np.zeros(4)  # overwritten for every rate
        self._rates: list[np.ndarray] = []

    @property
    def swings(self) -> bool:
        """Return whether there is a payload, which needs short steps."""
        return self._tether is not None

    @property
    def lags(self) -> bool:
        """Return whether rotors need time; others turn at the commanded speed at once."""
        return not math.isinf(self.tau_m)

    @property
    def carried_mass(self) -> float:
        """Return the mass of vehicle and payload [kg]."""
        return self.mass + (self._tether.mass if self._tether else 0.0)

    def payload(self, s: np.ndarray) -> np.ndarray:
        """Return the payload's position and velocity in W (6,) [m, m/s] in a state; empty (0,) without one."""
        return s[-Tether.size :] if self._tether else np.zeros(0)

    def hidden_at_rest(self, t: float, s: np.ndarray) -> np.ndarray:
        """Return what follows rotorpy's state `s` (20,) at rest: liquid still, payload hanging."""
        self._t, self._s, self._command = t, s, s[SPEED]
        now = self._instant(s[SPEED], np.zeros(3))
        drive = self.vehicle.mixer @ now.thrust
        parts = [effect.rest(drive) for effect in self._hidden]
        return np.concatenate([*parts, self._tether.hang(now) if self._tether else np.zeros(0)])

    def rate(self, t: float, s: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the derivative of the state `s` at commanded rotor speeds (4,) [rad/s]; writes the wind into `s`."""
        s[WIND] = sum(wind.update(t, s[X]) for wind in self._winds) if self._winds else 0.0
        self._t, self._s, self._command = t, s, command
        self._rates = []
        out = self._s_dot_fn(t, s[:SIZE], command)
        if self._tether is not None:
            motion = np.concatenate([out[V], out[W]])
            inertial = (self.mass, self.inv_inertia, self.center)
            pulled, rate = self._tether.pull(self._now, s[-Tether.size :], motion, inertial, self.g)
            out[V] += pulled[:3]
            out[W] += pulled[3:]
            self._rates.append(rate)
        return np.concatenate([out, *self._rates]) if self._rates else out

    def thrust(self, t: float, speed: np.ndarray) -> np.ndarray:
        """Return the thrust (4,) of propellers at these speeds (4,) [rad/s], far from the ground [N]."""
        thrust = self.k_eta * speed * speed
        for gain, values in self._gains:
            thrust = gain(self.vehicle, values, thrust, t)
        return thrust

    def compute_body_wrench(
        self, body_rates: np.ndarray, rotor_speeds: np.ndarray, body_airspeed_vector: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return force (3,) and torque (3,) about Bcm in B [N, N·m]: of rotorpy's rotors and of the effects."""
        if self._plain:
            return super().compute_body_wrench(body_rates, rotor_speeds, body_airspeed_vector)
        now = self._now = self._instant(rotor_speeds, body_airspeed_vector)
        thrust = now.thrust
        for values in self._ground:
            thrust = thrust * cushion(values, float(now.p[2]))
        worth = rotor_speeds  # of sound propellers with that thrust
        if self._gains or self._ground:
            worth = np.sqrt(np.maximum(thrust, 0.0) / self.k_eta)
        force, torque = super().compute_body_wrench(body_rates, worth, body_airspeed_vector)
        extra = np.zeros(6)
        for law, values in self._laws:
            extra += law(self.vehicle, values, now)
        if self._hidden:
            extra[2:] += self._given(now)
        if self._beside:
            extra[3:] -= cross(self.center, extra[:3])
        return force + extra[:3], torque + extra[3:]

    def _given(self, now: Instant) -> np.ndarray:
        """Return thrust and torque (4,) of effects with a hidden state [N, N·m]; keeps their rates."""
        total, at = np.zeros(4), SIZE
        for effect in self._hidden:
            given, rate = effect.act(self.vehicle.mixer @ now.thrust, self._s[at : at + effect.size])
            total += given
            at += effect.size
            self._rates.append(rate)
        return total

    def _instant(self, speed: np.ndarray, airspeed: np.ndarray) -> Instant:
        """Return the instant of the laws. airspeed: (3,) of Bcm in B [m/s]."""
        s, t = self._s, self._t
        thrust = self.thrust(t, speed)
        R = attitude.rotation_matrix(s[Q][[3, 0, 1, 2]])
        p, v, air = s[X], s[V], airspeed
        if self._beside:
            swept = cross(s[W], self.center)
            p, v, air = p - R @ self.center, v - R @ swept, air - swept
        spin_up = (self._command - speed) / self.tau_m
        return Instant(t, p, R, v, air, s[W], thrust, speed, spin_up)


def center_of_mass(acting: Sequence[ActiveEffect]) -> np.ndarray:
    """Return p_BoBcm_B (3,) [m]."""
    offsets = [a.values for a in acting if a.name == "center_of_mass_offset"]
    return np.array([sum(c[axis] for c in offsets) for axis in "xyz"], float)


def parameters(vehicle: Vehicle, acting: Sequence[ActiveEffect], *, tau_m: float = np.inf) -> dict:
    """Return rotorpy's parameters of a multirotor, with the effects that are parameters there.

    Args: tau_m: time constant of motors to which neither effect nor file gives one [s].
    """
    named = [(a.name, a.values) for a in acting]
    scale = float(np.prod([c["scale"] for name, c in named if name == "thrust_scale"]))
    J = vehicle.J.copy()
    for name, c in named:
        if name == "inertia_error":
            J[np.diag_indices(3)] *= [c["scale_xx"], c["scale_yy"], c["scale_zz"]]
    lag = [c["time_constant"] for name, c in named if name == "motor_lag"] or [vehicle.rotor_time_constant]
    places = np.array(vehicle.rotor_positions) - center_of_mass(acting)
    return {
        "mass": vehicle.mass + sum(c["delta_mass"] for name, c in named if name == "mass_error"),
        **{f"I{'xyz'[i]}{'xyz'[j]}": J[i, j] for i in range(3) for j in range(i, 3)},
        "num_rotors": 4,
        "rotor_pos": {f"r{i + 1}": place for i, place in enumerate(places)},
        "rotor_directions": np.array(vehicle.rotor_directions),
        "rotor_speed_min": 0.0,
        "rotor_speed_max": float(np.sqrt(vehicle.max_rotor_thrust / vehicle.thrust_coefficient)),
        "k_eta": scale * vehicle.thrust_coefficient,
        "k_m": scale * vehicle.torque_coefficient,
        "tau_m": lag[-1] if lag[-1] > 0 else tau_m,
    }
