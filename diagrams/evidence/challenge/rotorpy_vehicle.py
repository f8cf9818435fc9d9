"""rotorpy's multirotor with a challenge's vehicle and effects in it.

Rigid body, rotors, motors and the wind's state are rotorpy's, the tether and the gusts are written
here; every other effect acts by its own function, as in Drake.
Source: Folk, Paulos and Kumar 2023 (RotorPy), as a library.
"""

import math
from collections.abc import Sequence

import numpy as np
from rotorpy.vehicles.multirotor import Multirotor

from diagrams.evidence.challenge.sensors import gauss_markov
from np_drake import attitude
from np_drake.effects.base import Effect, Motion, WrenchEffect
from np_drake.effects.combine import mass_properties, split_effects
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.pendulum import hanging_still
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.vehicle import Vehicle

# rotorpy's own state: of Bcm, quaternion x, y, z, w; hidden states of effects and the payload's
# position and velocity follow.
X, V, Q, W, WIND, SPEED = (
    slice(*ends) for ends in ((0, 3), (3, 6), (6, 10), (10, 13), (13, 16), (16, 20))
)
SIZE = 20
# when gusts are blown, and how densely they are drawn [s]
FIRST = -8.0
LAST = 320.0
BLOWN = 0.005
# With which an error of a tether's length dies out, critically damped [1/s]; a slack tether
# tightens as softly.
RATE = 80.0
BAND = 1e-3  # of its length by which a taut tether may be too short [1]
# Of the integrator, at most [s]: one between rows 10 ms apart, jitter included, two with a tether.
STEP = 0.0112
TETHER_STEP = 0.0056
LAG_SHARE = 0.5  # of a motor's time constant that a step may last [1]


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the cross product of two (3,) in a tenth of the time of NumPy's."""
    a0, a1, a2 = a
    b0, b1, b2 = b
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def to_rotorpy(x: np.ndarray, center: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return rotorpy's state (20,) of a state (13,) of Bo, p_BoBcm_B (3,) [m] and rotor speeds (4,)
    [rad/s].
    """
    q = x[3:7] / np.linalg.norm(x[3:7])
    w = x[10:13]
    moved = attitude.rotate(q, center)
    swept = attitude.rotate(q, cross(w, center))
    return np.concatenate([x[0:3] + moved, x[7:10] + swept, q[[1, 2, 3, 0]], w, np.zeros(3), speed])


def from_rotorpy(s: np.ndarray, center: np.ndarray) -> np.ndarray:
    """Return the state (13,) of Bo of rotorpy's state and p_BoBcm_B (3,) [m]."""
    q = s[Q][[3, 0, 1, 2]]
    w = s[W]
    R = attitude.rotation_matrix(q)
    return np.concatenate([s[X] - R @ center, q, s[V] - R @ cross(w, center), w])


class Gusts:
    """A mean wind and a Gauss-Markov process on every axis, straight between its draws.

    Not Dryden, whose deviation and correlation time depend on height and speed.
    """

    def __init__(self, wind: GustyWind):
        t = np.arange(FIRST, LAST, BLOWN)
        rng = np.random.default_rng([wind.seed, 2])
        gusts = gauss_markov(rng, t, rms=wind.deviation, tau=wind.correlation_time)
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

    def hang(self, x: np.ndarray) -> np.ndarray:
        """Return the payload's state straight below the hook of a vehicle with state (13,), and
        moving with it.
        """
        return hanging_still(self.hook, x, self._payload.length)

    def pull(
        self, now: Motion, load: np.ndarray, motion: np.ndarray, inertial: tuple, gravity: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the tether's part (6,) of the vehicle's accelerations, and the rate (6,) of the
        payload's state.

        Args:
            load: (6,) state of the payload.
            motion: (6,) [dv/dt of Bcm in W, dw/dt in B] without the tether [m/s², rad/s²].
            inertial: mass [kg], inverse inertia (3, 3), p_BoBcm_B (3,) of the vehicle.
        """
        mass, J_inverse, center = inertial
        length = self._payload.length
        w = now.x[10:]
        arm = self.hook - center
        x, y, z = w.tolist()
        way = load[:3] - now.x[:3] - now.R_WB @ self.hook
        span = math.sqrt(float(way @ way))
        fall = np.array([0.0, 0.0, -gravity]) - self._payload.damping * load[3:]
        if span < (1 - BAND) * length:
            return np.zeros(6), np.concatenate([load[3:], fall])
        n = way / span
        rate = load[3:] - now.x[7:10] - now.R_WB @ cross(w, self.hook)
        n_B = n @ now.R_WB
        lever = cross(arm, n_B)
        along = float(n @ rate)
        inward = w * float(w @ arm) - arm * (x * x + y * y + z * z)  # w x (w x arm)
        # Acceleration of the hook along the tether.
        hook = float(n @ motion[:3] + lever @ motion[3:] + n_B @ inward)
        wanted = float(n @ fall) - hook + (float(rate @ rate) - along * along) / span
        wanted += 2 * RATE * along + RATE**2 * (span - length)
        turn = J_inverse @ lever
        tension = max(wanted / (1 / self._payload.mass + 1 / mass + float(lever @ turn)), 0.0)
        pulled = tension * np.concatenate([n / mass, turn])
        return pulled, np.concatenate([load[3:], fall - tension / self._payload.mass * n])


class RotorPyWorld(Multirotor):
    """A multirotor of rotorpy with one set of effects: its rigid body, rotors, motor lag and wind
    state; other effects join its body wrench. Classical Runge-Kutta of fourth order integrates it.

    rotorpy's own parameters are mass, inertia, place of the rotors from the centre of mass, thrust
    and torque coefficient (`thrust_scale`), motor time constant (infinite: none, and the command is
    the speed) and gravity. Its ground plane and its own aerodynamics are off. Other effects act by
    the functions of the effect itself, all on the same thrusts; one with a hidden state adds to
    them.
    """

    def __init__(self, vehicle: Vehicle, effects: Sequence[Effect]):
        """Build the vehicle. Raises ValueError: on two payloads, or what is no effect."""
        places = split_effects(effects)
        body = mass_properties(vehicle, places.mass)
        scales = [effect.scale for effect in places.actuator if isinstance(effect, ThrustScale)]
        lags = [effect.time_constant for effect in places.actuator if isinstance(effect, MotorLag)]
        lag = (lags or [vehicle.rotor_time_constant])[-1]
        scale = float(np.prod(scales))
        rotors = vehicle.rotor_positions_B - body.p_BoBcm_B
        given = {
            "mass": body.mass,
            **{f"I{'xyz'[i]}{'xyz'[j]}": body.J[i, j] for i in range(3) for j in range(i, 3)},
            "num_rotors": 4,
            "rotor_pos": {f"r{i + 1}": place for i, place in enumerate(rotors)},
            "rotor_directions": np.array(vehicle.rotor_directions),
            "rotor_speed_min": 0.0,
            "rotor_speed_max": np.inf,  # the controller's command is within its bounds
            "k_eta": scale * vehicle.thrust_coefficient,
            "k_m": scale * vehicle.torque_coefficient,
            "tau_m": lag if lag > 0 else np.inf,
        }
        super().__init__(given, aero=False, enable_ground=False)
        self.g = vehicle.gravity
        self.weight = np.array([0.0, 0.0, -self.mass * self.g])
        self._vehicle = vehicle
        self._center = body.p_BoBcm_B
        self.dead_time = sum(effect.dead_time for effect in places.actuator)  # of commands [s]
        self._winds = [
            Gusts(e) if isinstance(e, GustyWind) else e.air_velocity
            for e in places.wrench
            if type(e).air_velocity is not WrenchEffect.air_velocity
        ]
        self._pushes = [e for e in places.wrench if e.pushes or e.turns]
        of_rotorpy = (MotorLag, ThrustScale)
        others = [e for e in places.actuator if not (isinstance(e, of_rotorpy) or e.dead_time)]
        self._gains = [effect for effect in others if not effect.state_size]
        self._hidden = [effect for effect in others if effect.state_size]
        self._tether = None if places.payload is None else Tether(places.payload)
        self._step = min(TETHER_STEP if self._tether else STEP, LAG_SHARE * self.tau_m)
        self._command = self._rotor_speeds(vehicle.hover_input)  # [rad/s]

    def _rotor_speeds(self, u: np.ndarray) -> np.ndarray:
        """Return the rotor speeds (4,) that a nominal vehicle needs [rad/s]."""
        thrust = np.maximum(self._vehicle.unmixer @ u, 0.0)
        return np.sqrt(thrust / self._vehicle.thrust_coefficient)

    def start(self, t: float, x: np.ndarray, before: "RotorPyWorld | None" = None) -> None:
        """Put the vehicle into a state (13,) at t [s]; a payload hangs still under the moving hook,
        liquid is still.

        Rotors and acting command carry on from the world before.
        """
        speed = self._command
        if before is not None:
            self._command = before._command
            speed = before.speed()
        s = to_rotorpy(x, self._center, speed)
        now = self._motion(t, s, speed)
        parts = [effect.state_at(self._vehicle, now.rotor_thrust) for effect in self._hidden]
        parts += [self._tether.hang(now.x)] if self._tether else []
        self._t = t
        self._s = np.concatenate([s, *parts])

    def state(self) -> np.ndarray:
        """Return the state (13,) of Bo."""
        return from_rotorpy(self._s, self._center)

    def speed(self) -> np.ndarray:
        """Return the rotor speeds (4,) [rad/s]."""
        return self._s[SPEED].copy()

    def reading(self) -> np.ndarray:
        """Return (19,) state of Bo, its acceleration in W and dw/dt in B."""
        rate = self._rate(self._t, self._s)
        center = self._center
        w = self._s[W]
        swept = cross(rate[W], center) + cross(w, cross(w, center))
        a = rate[V] - attitude.rotate(self._s[Q][[3, 0, 1, 2]], swept)
        return np.concatenate([self.state(), a, rate[W]])

    def command(self, u: np.ndarray) -> None:
        """Let a command (4,) act from now on [N, N·m]."""
        self._command = self._rotor_speeds(u)
        if math.isinf(self.tau_m):
            self._s[SPEED] = self._command

    def integrate(self, t: float) -> None:
        """Fly on to t [s], in equal steps."""
        steps = math.ceil((t - self._t) / self._step - 1e-6)
        h = (t - self._t) / steps
        for _ in range(steps):
            s = self._s
            middle = self._t + 0.5 * h
            k1 = self._rate(self._t, s)
            k2 = self._rate(middle, s + 0.5 * h * k1)
            k3 = self._rate(middle, s + 0.5 * h * k2)
            k4 = self._rate(self._t + h, s + h * k3)
            self._s = s + h / 6 * (k1 + 2 * (k2 + k3) + k4)
            self._s[Q] /= math.sqrt(float(self._s[Q] @ self._s[Q]))
            self._t += h
        self._t = t

    def _rate(self, t: float, s: np.ndarray) -> np.ndarray:
        """Return the derivative of a state under the acting command; writes the wind into `s`."""
        s[WIND] = sum(wind(t) for wind in self._winds)
        self._now = self._motion(t, s, s[SPEED])
        remaining = s[SIZE:]
        rates = []
        thrust = self._now.rotor_thrust
        self._added = np.zeros(4)  # thrust and torque of effects with a hidden state [N, N·m]
        for effect in self._hidden:
            hidden, remaining = np.split(remaining, [effect.state_size])
            given = effect.thrust(self._vehicle, hidden, thrust, t)
            self._added += self._vehicle.mixer @ (given - thrust)
            rates.append(effect.state_rate(self._vehicle, hidden, thrust))
        out = self._s_dot_fn(t, s[:SIZE], self._command)
        if self._tether is not None:
            motion = np.concatenate([out[V], out[W]])
            inertial = (self.mass, self.inv_inertia, self._center)
            pulled, rate = self._tether.pull(self._now, remaining, motion, inertial, self.g)
            out[V] += pulled[:3]
            out[W] += pulled[3:]
            rates.append(rate)
        return np.concatenate([out, *rates])

    def compute_body_wrench(
        self, body_rates: np.ndarray, rotor_speeds: np.ndarray, body_airspeed_vector: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return force (3,) and torque (3,) about Bcm in B [N, N·m], of rotorpy's rotors and of the
        effects.

        Rates (3,) are in B [rad/s], speeds (4,) in rad/s, the air speed (3,) is that of Bcm in B.
        """
        now = self._now
        worth = rotor_speeds
        if self._gains:  # speeds of sound propellers with that thrust
            worth = np.sqrt(np.maximum(now.rotor_thrust, 0.0) / self.k_eta)
        force, torque = super().compute_body_wrench(body_rates, worth, body_airspeed_vector)
        extra = sum((e.wrench(self._vehicle, now) for e in self._pushes), np.zeros(6))
        extra[:3] = extra[:3] @ now.R_WB
        extra[2:] += self._added
        extra[3:] -= cross(self._center, extra[:3])
        return force + extra[:3], torque + extra[3:]

    def _motion(self, t: float, s: np.ndarray, speed: np.ndarray) -> Motion:
        """Return what the effects depend on, at rotor speeds (4,) [rad/s]."""
        thrust = self.k_eta * speed * speed
        for gain in self._gains:
            thrust = gain.thrust(self._vehicle, np.zeros(0), thrust, t)
        spin_up = (self._command - speed) / self.tau_m
        turning = self._vehicle.thrust_coefficient * speed * speed
        return Motion(t, from_rotorpy(s, self._center), thrust, s[WIND], spin_up, turning)
