"""rotorpy's multirotor with a challenge's vehicle and effects in it."""

import dataclasses as dc
import math
from collections.abc import Sequence

import numpy as np
from rotorpy.vehicles.hummingbird_params import quad_params
from rotorpy.vehicles.multirotor import Multirotor

from diagrams.challenge.simulators.rotorpy.conversion import (
    SIZE,
    SPEED,
    WIND,
    V,
    W,
    X,
    cross,
    from_rotorpy,
)
from diagrams.challenge.simulators.rotorpy.tether import Tether
from diagrams.challenge.simulators.rotorpy.wind import winds
from np_drake.effects.base import (
    ActuatorEffect,
    Effect,
    MassProperties,
    MeasurementEffect,
    Motion,
    WrenchEffect,
)
from np_drake.effects.combine import mass_properties, split_effects
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.vehicle import Vehicle

# rotorpy's own aerodynamics and motors, which no effect of this project has exactly: drag of the
# body, drag and inflow of the rotors, their lift and flapping, and the motors' time constant.
OWN = ("c_Dx", "c_Dy", "c_Dz", "k_d", "k_z", "k_h", "k_flap", "tau_m")
_NO_STATE = np.zeros(0)


def own_physics() -> dict[str, float]:
    """Return these parameters of the vehicle that comes with rotorpy, the Hummingbird, as they
    stand there [SI].
    """
    return {name: float(quad_params[name]) for name in OWN}


class RealMultirotor(Multirotor):
    """A multirotor of rotorpy: its rigid body, rotors, motor lag and wind state; other effects join
    its body wrench.

    rotorpy's own parameters are mass, inertia, place of the rotors from the centre of mass, thrust
    and torque coefficient (`thrust_scale`), motor time constant (infinite: none, and the command is
    the speed) and gravity. Its ground plane is off. Other effects act by the functions of the
    effect itself, all on the same thrusts; one with a
    hidden state adds to them. `center`: (3,) p_BoBcm_B [m].   `dead_time`: of commands [s].
    """

    def __init__(
        self, vehicle: Vehicle, effects: Sequence[Effect | MeasurementEffect], *, own: bool = False
    ):
        """Build the vehicle.

        Args:
            own: whether rotorpy's own aerodynamics act, and its own motor lag where neither effect
                nor file has one.

        Raises: ValueError: on two payloads, or what is no effect.
        """
        places = split_effects(effects)
        physics = own_physics() if own else {}
        body = mass_properties(vehicle, places.mass)
        given = parameters(vehicle, body, places.actuator, tau_m=physics.get("tau_m", np.inf))
        super().__init__(physics | given, aero=own, enable_ground=False)
        self.g = vehicle.gravity
        self.weight = np.array([0.0, 0.0, -self.mass * self.g])
        self.vehicle, self.center = vehicle, body.p_BoBcm_B
        self.dead_time = sum(effect.dead_time for effect in places.actuator)
        self._winds = winds(places.wrench)
        self._pushes = [e for e in places.wrench if type(e).wrench is not WrenchEffect.wrench]
        others = [
            e
            for e in places.actuator
            if not (isinstance(e, (MotorLag, ThrustScale)) or e.dead_time)
        ]
        self._gains = [effect for effect in others if not effect.state_size]
        self._hidden = [effect for effect in others if effect.state_size]
        self._tether = None if places.payload is None else Tether(places.payload)
        self._plain = not (self._pushes or others or self._tether)
        self._t, self._s, self._command = (
            0.0,
            np.zeros(SIZE),
            np.zeros(4),
        )  # overwritten for every rate
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
        """Return the payload's position and velocity in W (6,) [m, m/s] in a state; empty (0,)
        without one.
        """
        return s[-Tether.size :] if self._tether else np.zeros(0)

    def hidden_at_rest(self, t: float, s: np.ndarray) -> np.ndarray:
        """Return what follows rotorpy's own state at rest: liquid still, payload hanging.

        Args:
            t: [s].
            s: (20,) rotorpy's own state.
        """
        self._t, self._s, self._command = t, s, s[SPEED]
        now = self._motion(s[SPEED])
        parts = [effect.state_at(self.vehicle, now.rotor_thrust) for effect in self._hidden]
        return np.concatenate([*parts, self._tether.hang(now) if self._tether else np.zeros(0)])

    def rate(self, t: float, s: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the derivative of the state; writes the wind into `s`.

        Args:
            t: [s].
            command: (4,) rotor speeds [rad/s].
        """
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
        """Return the thrust (4,) of propellers, far from the ground [N].

        Args:
            t: [s].
            speed: (4,) of the rotors [rad/s].
        """
        thrust = self.k_eta * speed * speed
        for gain in self._gains:
            thrust = gain.thrust(self.vehicle, _NO_STATE, thrust, t)
        return thrust

    def compute_body_wrench(
        self, body_rates: np.ndarray, rotor_speeds: np.ndarray, body_airspeed_vector: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return force (3,) and torque (3,) about Bcm in B [N, N·m], of rotorpy's rotors and of the
        effects.

        Args:
            body_rates: (3,) in B [rad/s].
            rotor_speeds: (4,) [rad/s].
            body_airspeed_vector: (3,) of Bcm through the air, in B [m/s].
        """
        if self._plain:
            return super().compute_body_wrench(body_rates, rotor_speeds, body_airspeed_vector)
        now = self._now = self._motion(rotor_speeds)
        worth = rotor_speeds  # of sound propellers with that thrust
        if self._gains:
            worth = np.sqrt(np.maximum(now.rotor_thrust, 0.0) / self.k_eta)
        force, torque = super().compute_body_wrench(body_rates, worth, body_airspeed_vector)
        extra = np.zeros(6)
        for effect in self._pushes:
            felt = self._turning(rotor_speeds, now) if isinstance(effect, RotorGyroscopic) else now
            extra += effect.wrench(self.vehicle, felt)
        extra[:3] = extra[:3] @ now.R_WB
        extra[2:] += self._added(now.rotor_thrust)
        extra[3:] -= cross(self.center, extra[:3])
        return force + extra[:3], torque + extra[3:]

    def _added(self, thrust: np.ndarray) -> np.ndarray:
        """Return thrust and torque (4,) of effects with a hidden state [N, N·m]; keeps their
        rates.
        """
        total, at = np.zeros(4), SIZE
        for effect in self._hidden:
            own = self._s[at : at + effect.state_size]
            total += self.vehicle.mixer @ (
                effect.thrust(self.vehicle, own, thrust, self._t) - thrust
            )
            self._rates.append(effect.state_rate(self.vehicle, own, thrust))
            at += effect.state_size
        return total

    def _motion(self, speed: np.ndarray) -> Motion:
        """Return what the effects depend on, at rotor speeds (4,) [rad/s]."""
        x, spin_up = from_rotorpy(self._s, self.center), (self._command - speed) / self.tau_m
        return Motion(self._t, x, self.thrust(self._t, speed), self._s[WIND], spin_up)

    def _turning(self, speed: np.ndarray, now: Motion) -> Motion:
        """Return the motion with the thrusts that these speeds (4,) show: momentum is theirs,
        whatever blades give.
        """
        return dc.replace(now, rotor_thrust=self.vehicle.thrust_coefficient * speed * speed)


def parameters(
    vehicle: Vehicle,
    body: MassProperties,
    effects: Sequence[ActuatorEffect],
    *,
    tau_m: float = np.inf,
) -> dict:
    """Return rotorpy's parameters of a multirotor, with the effects that are parameters there.

    Args:
        tau_m: time constant of motors to which neither effect nor file gives one [s].
    """
    scale = float(np.prod([effect.scale for effect in effects if isinstance(effect, ThrustScale)]))
    lags = [effect.time_constant for effect in effects if isinstance(effect, MotorLag)]
    lag = (lags or [vehicle.rotor_time_constant])[-1]
    places = np.array(vehicle.rotor_positions) - body.p_BoBcm_B
    return {
        "mass": body.mass,
        **{f"I{'xyz'[i]}{'xyz'[j]}": body.J[i, j] for i in range(3) for j in range(i, 3)},
        "num_rotors": 4,
        "rotor_pos": {f"r{i + 1}": place for i, place in enumerate(places)},
        "rotor_directions": np.array(vehicle.rotor_directions),
        "rotor_speed_min": 0.0,
        "rotor_speed_max": float(np.sqrt(vehicle.max_rotor_thrust / vehicle.thrust_coefficient)),
        "k_eta": scale * vehicle.thrust_coefficient,
        "k_m": scale * vehicle.torque_coefficient,
        "tau_m": lag if lag > 0 else tau_m,
    }
