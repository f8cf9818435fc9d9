"""rotorpy's multirotor with a challenge's vehicle and effects in it.

Rigid body, rotors, motors and the wind's state are rotorpy's, the tether and the gusts are written
here; every other effect acts by its own function, as in Drake.
Source: Folk, Paulos and Kumar 2023 (RotorPy), as a library.
"""

import dataclasses as dc
import math
from collections.abc import Sequence

import numpy as np
from rotorpy.vehicles.multirotor import Multirotor

from diagrams.challenge.sensors import gauss_markov
from np_drake import attitude
from np_drake.effects.base import (
    ActuatorEffect,
    Effect,
    MassProperties,
    MeasurementEffect,
    Motion,
    WrenchEffect,
)
from np_drake.effects.combine import mass_properties, split_effects
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.vehicle import Vehicle

# rotorpy's own state: of Bcm, quaternion x, y, z, w; hidden states of effects and the payload's
# position and velocity follow.
X, V, Q, W, WIND, SPEED = (
    slice(*ends) for ends in ((0, 3), (3, 6), (6, 10), (10, 13), (13, 16), (16, 20))
)
SIZE = 20
PAYLOAD = slice(-6, None)
FIRST, LAST, BLOWN = -8.0, 320.0, 0.005  # when gusts are blown, and how densely they are drawn [s]
# With which an error of a tether's length dies out, critically damped [1/s]; a slack tether
# tightens as softly.
RATE = 80.0
BAND = 1e-3  # of its length by which a taut tether may be too short [1]
# Of the integrator, at most [s]: one between rows 10 ms apart, jitter included, two with a tether.
STEP, TETHER_STEP = 0.0112, 0.0056
LAG_SHARE = 0.5  # of a motor's time constant that a step may last [1]


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the cross product of two (3,) in a tenth of the time of NumPy's."""
    (a0, a1, a2), (b0, b1, b2) = a, b
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def to_rotorpy(x: np.ndarray, center: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return rotorpy's state (20,) of a state (13,) of Bo, p_BoBcm_B (3,) [m] and rotor speeds (4,)
    [rad/s].
    """
    q, w = x[3:7] / np.linalg.norm(x[3:7]), x[10:13]
    moved, swept = attitude.rotate(q, center), attitude.rotate(q, cross(w, center))
    return np.concatenate([x[0:3] + moved, x[7:10] + swept, q[[1, 2, 3, 0]], w, np.zeros(3), speed])


def from_rotorpy(s: np.ndarray, center: np.ndarray) -> np.ndarray:
    """Return the state (13,) of Bo of rotorpy's state and p_BoBcm_B (3,) [m]."""
    q, w = s[Q][[3, 0, 1, 2]], s[W]
    R = attitude.rotation_matrix(q)
    return np.concatenate([s[X] - R @ center, q, s[V] - R @ cross(w, center), w])


def rotor_speeds(vehicle: Vehicle, u: np.ndarray) -> np.ndarray:
    """Return the rotor speeds (4,) [rad/s] that a nominal vehicle needs for a command (4,) [N,
    N·m].
    """
    return np.sqrt(np.clip(vehicle.unmixer @ u, 0.0, np.inf) / vehicle.thrust_coefficient)


class Gusts:
    """A mean wind and a Gauss-Markov process on every axis, straight between its draws.

    Not Dryden, whose deviation and correlation time depend on height and speed.
    """

    def __init__(self, wind: GustyWind):
        t = np.arange(FIRST, LAST, BLOWN)
        rng = np.random.default_rng([wind.seed, 2])
        gusts = gauss_markov(rng, t, 3, rms=wind.deviation, tau=wind.correlation_time)
        self._path = gusts + [wind.mean_x, wind.mean_y, wind.mean_z]

    def __call__(self, t: float) -> np.ndarray:
        """Return the velocity of the air (3,) in W at t [s], the same everywhere [m/s]."""
        row = min(max((t - FIRST) / BLOWN, 0.0), len(self._path) - 1.001)
        k = int(row)
        return self._path[k] + (row - k) * (self._path[k + 1] - self._path[k])


class Tether:
    """A point mass on a tether that pulls only, in still air. State (6,): its position and velocity
    in W [m, m/s].

    The tension is that with which d²|r|/dt² = -2 RATE d|r|/dt - RATE² (|r| - L), r from hook to
    payload, given the accelerations that vehicle and payload have without it.
    Source: Newton and Euler for both bodies; index reduction with Baumgarte's stabilisation.
    """

    def __init__(self, payload: SuspendedPayload):
        self._payload = payload
        self.hook = np.array([payload.hook_x, payload.hook_y, payload.hook_z])

    def hang(self, now: Motion) -> np.ndarray:
        """Return the payload's state straight below the hook, and moving with it."""
        below = now.x[:3] + now.R_WB @ self.hook - [0.0, 0.0, self._payload.length]
        return np.concatenate([below, now.x[7:10] + now.R_WB @ cross(now.x[10:], self.hook)])

    def pull(
        self, now: Motion, own: np.ndarray, motion: np.ndarray, inertial: tuple, gravity: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the tether's part (6,) of the vehicle's accelerations, and the rate (6,) of the
        payload's state.

        Args:
            motion: (6,) [dv/dt of Bcm in W, dw/dt in B] without the tether [m/s², rad/s²].
            inertial: mass [kg], inverse inertia (3, 3), p_BoBcm_B (3,) of the vehicle.
        """
        mass, J_inverse, center = inertial
        load, length, w = self._payload.mass, self._payload.length, now.x[10:]
        arm, (x, y, z) = self.hook - center, w.tolist()
        way = own[:3] - now.x[:3] - now.R_WB @ self.hook
        span = math.sqrt(float(way @ way))
        fall = np.array([0.0, 0.0, -gravity]) - self._payload.damping * own[3:]
        if span < (1 - BAND) * length:
            return np.zeros(6), np.concatenate([own[3:], fall])
        n, rate = way / span, own[3:] - now.x[7:10] - now.R_WB @ cross(w, self.hook)
        n_B = n @ now.R_WB
        lever, along = cross(arm, n_B), float(n @ rate)
        inward = w * float(w @ arm) - arm * (x * x + y * y + z * z)  # w x (w x arm)
        # Acceleration of the hook along the tether.
        hook = float(n @ motion[:3] + lever @ motion[3:] + n_B @ inward)
        wanted = float(n @ fall) - hook + (float(rate @ rate) - along * along) / span
        wanted += 2 * RATE * along + RATE**2 * (span - length)
        turn = J_inverse @ lever
        tension = max(wanted / (1 / load + 1 / mass + float(lever @ turn)), 0.0)
        pulled = tension * np.concatenate([n / mass, turn])
        return pulled, np.concatenate([own[3:], fall - tension / load * n])


class RealMultirotor(Multirotor):
    """A multirotor of rotorpy: its rigid body, rotors, motor lag and wind state; other effects join
    its body wrench.

    rotorpy's own parameters are mass, inertia, place of the rotors from the centre of mass, thrust
    and torque coefficient (`thrust_scale`), motor time constant (infinite: none, and the command is
    the speed) and gravity. Its ground plane and its own aerodynamics are off. Other effects act by
    the functions of the effect itself, all on the same thrusts; one with a hidden state adds to
    them. `center`: (3,) p_BoBcm_B [m].   `dead_time`: of commands [s].
    """

    def __init__(self, vehicle: Vehicle, effects: Sequence[Effect | MeasurementEffect]):
        """Build the vehicle. Raises ValueError: on two payloads, or what is no effect."""
        places = split_effects(effects)
        body = mass_properties(vehicle, places.mass)
        given = parameters(vehicle, body, places.actuator)
        super().__init__(given, aero=False, enable_ground=False)
        self.g = vehicle.gravity
        self.weight = np.array([0.0, 0.0, -self.mass * self.g])
        self.vehicle, self.center = vehicle, body.p_BoBcm_B
        self.dead_time = sum(effect.dead_time for effect in places.actuator)
        self._winds = [
            Gusts(e) if isinstance(e, GustyWind) else e.air_velocity
            for e in places.wrench
            if type(e).air_velocity is not WrenchEffect.air_velocity
        ]
        self._pushes = [e for e in places.wrench if type(e).wrench is not WrenchEffect.wrench]
        others = [
            e
            for e in places.actuator
            if not (isinstance(e, (MotorLag, ThrustScale)) or e.dead_time)
        ]
        self._gains = [effect for effect in others if not effect.state_size]
        self._hidden = [effect for effect in others if effect.state_size]
        self.tether = None if places.payload is None else Tether(places.payload)
        self.lags = not math.isinf(self.tau_m)  # others turn at the commanded speed at once
        # Overwritten for every rate.
        self._t, self._s, self._command = 0.0, np.zeros(SIZE), np.zeros(4)
        self._rates: list[np.ndarray] = []

    def hidden_at_rest(self, t: float, s: np.ndarray) -> np.ndarray:
        """Return what follows rotorpy's own state (20,) at t [s] at rest: liquid still, payload
        hanging.
        """
        self._t, self._s, self._command = t, s, s[SPEED]
        now = self._motion(s[SPEED])
        parts = [effect.state_at(self.vehicle, now.rotor_thrust) for effect in self._hidden]
        return np.concatenate([*parts, self.tether.hang(now) if self.tether else np.zeros(0)])

    def rate(self, t: float, s: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the derivative of the state at t [s] under commanded rotor speeds (4,) [rad/s];
        writes the wind into `s`.
        """
        s[WIND] = sum(wind(t) for wind in self._winds) if self._winds else 0.0
        self._t, self._s, self._command = t, s, command
        self._rates = []
        out = self._s_dot_fn(t, s[:SIZE], command)
        if self.tether is not None:
            motion = np.concatenate([out[V], out[W]])
            inertial = (self.mass, self.inv_inertia, self.center)
            pulled, rate = self.tether.pull(self._now, s[PAYLOAD], motion, inertial, self.g)
            out[V] += pulled[:3]
            out[W] += pulled[3:]
            self._rates.append(rate)
        return np.concatenate([out, *self._rates]) if self._rates else out

    def thrust(self, t: float, speed: np.ndarray) -> np.ndarray:
        """Return the thrust (4,) of propellers far from the ground at t [s] and speeds (4,) [N]."""
        thrust = self.k_eta * speed * speed
        for gain in self._gains:
            thrust = gain.thrust(self.vehicle, np.zeros(0), thrust, t)
        return thrust

    def compute_body_wrench(
        self, body_rates: np.ndarray, rotor_speeds: np.ndarray, body_airspeed_vector: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return force (3,) and torque (3,) about Bcm in B [N, N·m], of rotorpy's rotors and of the
        effects.

        Rates (3,) are in B [rad/s], speeds (4,) in rad/s, the air speed (3,) is that of Bcm in B.
        """
        now = self._now = self._motion(rotor_speeds)
        worth = rotor_speeds  # of sound propellers with that thrust
        if self._gains:
            worth = np.sqrt(np.maximum(now.rotor_thrust, 0.0) / self.k_eta)
        force, torque = super().compute_body_wrench(body_rates, worth, body_airspeed_vector)
        # Momentum is that of the turning rotors, whatever their blades give.
        turning = self.vehicle.thrust_coefficient * rotor_speeds * rotor_speeds
        extra = np.zeros(6)
        for effect in self._pushes:
            gyroscopic = isinstance(effect, RotorGyroscopic)
            felt = dc.replace(now, rotor_thrust=turning) if gyroscopic else now
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
            given = effect.thrust(self.vehicle, own, thrust, self._t)
            total += self.vehicle.mixer @ (given - thrust)
            self._rates.append(effect.state_rate(self.vehicle, own, thrust))
            at += effect.state_size
        return total

    def _motion(self, speed: np.ndarray) -> Motion:
        """Return what the effects depend on, at rotor speeds (4,) [rad/s]."""
        x, spin_up = from_rotorpy(self._s, self.center), (self._command - speed) / self.tau_m
        return Motion(self._t, x, self.thrust(self._t, speed), self._s[WIND], spin_up)


def parameters(vehicle: Vehicle, body: MassProperties, effects: Sequence[ActuatorEffect]) -> dict:
    """Return rotorpy's parameters of a multirotor, with the effects that are parameters there."""
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
        "tau_m": lag if lag > 0 else np.inf,
    }


class RotorPyWorld:
    """rotorpy's multirotor, which classical Runge-Kutta of fourth order integrates."""

    def __init__(self, vehicle: Vehicle, effects: Sequence[Effect]):
        """Build the vehicle."""
        self._real = RealMultirotor(vehicle, effects)
        self.dead_time = self._real.dead_time  # of commands [s]
        longest = TETHER_STEP if self._real.tether else STEP
        self._step = min(longest, LAG_SHARE * self._real.tau_m)
        self.command_speed = rotor_speeds(vehicle, vehicle.hover_input)  # [rad/s]

    def start(self, t: float, x: np.ndarray, before: "RotorPyWorld | None" = None) -> None:
        """Put the vehicle into a state (13,) at t [s]; a payload hangs still under the moving hook.

        Rotors and acting command carry on from the world before.
        """
        speed = self.command_speed
        if before is not None:
            self.command_speed, speed = before.command_speed, before.speed()
        s = to_rotorpy(x, self._real.center, speed)
        self._t, self._s = t, np.concatenate([s, self._real.hidden_at_rest(t, s)])

    def state(self) -> np.ndarray:
        """Return the state (13,) of Bo."""
        return from_rotorpy(self._s, self._real.center)

    def speed(self) -> np.ndarray:
        """Return the rotor speeds (4,) [rad/s]."""
        return self._s[SPEED].copy()

    def reading(self) -> np.ndarray:
        """Return (19,) state of Bo, its acceleration in W and dw/dt in B."""
        rate, center = self._real.rate(self._t, self._s, self.command_speed), self._real.center
        w, al = self._s[W], rate[W]
        swept = cross(al, center) + cross(w, cross(w, center))
        a = rate[V] - attitude.rotate(self._s[Q][[3, 0, 1, 2]], swept)
        return np.concatenate([self.state(), a, al])

    def unpacked(self, readings: np.ndarray) -> np.ndarray:
        """Return readings (n, 19) as they are."""
        return readings

    def command(self, u: np.ndarray) -> None:
        """Let a command (4,) act from now on [N, N·m]."""
        self.command_speed = rotor_speeds(self._real.vehicle, u)
        if not self._real.lags:
            self._s[SPEED] = self.command_speed

    def integrate(self, t: float) -> None:
        """Fly on to t [s], in equal steps."""
        rate, command = self._real.rate, self.command_speed
        steps = math.ceil((t - self._t) / self._step - 1e-6)
        h = (t - self._t) / steps
        for _ in range(steps):
            s, middle = self._s, self._t + 0.5 * h
            k1 = rate(self._t, s, command)
            k2 = rate(middle, s + 0.5 * h * k1, command)
            k3 = rate(middle, s + 0.5 * h * k2, command)
            k4 = rate(self._t + h, s + h * k3, command)
            self._s = s + h / 6 * (k1 + 2 * (k2 + k3) + k4)
            self._s[Q] /= math.sqrt(float(self._s[Q] @ self._s[Q]))
            self._t += h
        self._t = t
