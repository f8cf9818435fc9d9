"""Autopilot that is simulated: holds its place, and follows a companion by MAVLink while that is
heard.
"""

import numpy as np

from np_drake import attitude
from np_drake.autopilot.mavlink import AUTOPILOT, Codec, Command, HoldPlace
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop, ThrottleMap

# without a command after which the autopilot holds its place [s]; source: PX4's COM_OF_LOSS_T is 1
# s
LOST = 0.5
# how long commands have come when the pilot hands over, and the longest gap meanwhile [s]
ALIVE = 1.5
GAP = 0.2
# after a hand-over, in which what is in force is not told [s]; source: PX4's ATTITUDE_TARGET stream
QUIET = 0.5
HEARTBEAT = 1.0  # between two [s]; source: MAVLink's heartbeat protocol
STATE_PERIOD = 0.01  # between two states [s]
BOOT = 7.0  # its clock at the beginning [s]
# of the hold [1/s², 1/s, 1/s³]; source: own choice
STIFFNESS = 4.0
DAMPING = 3.0
INTEGRAL = 1.5
MOST = 4.0  # largest acceleration of the hold [m/s²]; source: own choice
# share by which a battery's voltage may differ from that of the map [1]; source: own choice
BELIEVED = 0.3
TURN = 4.0  # body rate over the error of tilt [1/s]; source: own choice


class SimulatedAutopilot:
    """Modes and messages of an autopilot of PX4's kind.

    It is armed and in hold. A pilot hands over once commands have come for `ALIVE`, and the
    autopilot takes over where none has come for `LOST`.
    """

    def __init__(self, vehicle: Vehicle):
        self._vehicle = vehicle
        self._loop = vehicle.rate_loop or RateLoop()
        self.codec = Codec(AUTOPILOT)
        self.boot = BOOT  # its clock less the simulation's [s]
        self.engaged = False
        self.handovers: list[float] = []  # when the pilot handed over [s]
        self.failsafes: list[float] = []  # when the autopilot took over [s]
        # by the companion, which must fall silent before the pilot hands over again
        self.asked_to_hold = False
        self._commanded: Command | None = None
        self._told_at = -np.inf
        self._alive_since = np.inf
        self._place: np.ndarray | None = None
        self._sum = np.zeros(3)
        self._stepped = 0.0
        self._next_state = self._next_heartbeat = 0.0
        self.in_force = np.zeros(4)  # thrust and body rates [N, rad/s]

    def take(self, data: bytes, t: float) -> None:
        """Take what has come by the link at a time [s]."""
        for message in self.codec.parse(data):
            if isinstance(message, Command) and np.isfinite(message.values).all():
                self._alive_since = t if t - self._told_at > GAP else min(self._alive_since, t)
                self.asked_to_hold = self.asked_to_hold and t - self._told_at <= GAP
                self._commanded = message
                self._told_at = t
            elif isinstance(message, HoldPlace):
                self.hold()
                self.asked_to_hold = True

    def hold(self) -> None:
        """Take over, and hold the place."""
        self.engaged = False
        self._place = None
        self._alive_since = np.inf

    def step(self, t: float, x: np.ndarray) -> np.ndarray:
        """Return collective thrust and body rates (4,) in force from a time [s] on, at a state
        (13,) [N, rad/s].
        """
        alive = t - self._told_at <= GAP and t - self._alive_since >= ALIVE
        if self.engaged and t - self._told_at > LOST:
            self.hold()
            self.failsafes.append(t)
        elif not self.engaged and not self.asked_to_hold and alive:
            self.engaged = True
            self.handovers.append(t)
        if self.engaged and self._commanded is not None:
            most = np.array(self._loop.max_rate)
            rates = np.clip(self._commanded.rates, -most, most)
            self.in_force = np.array([thrust_of(self._vehicle, self._commanded.thrust), *rates])
        else:
            self.in_force = self._hold(t, x)
        return self.in_force

    def messages(self, t: float, x: np.ndarray, acceleration: np.ndarray) -> bytes:
        """Return what is due at a time [s], at a state (13,) and [a in W, al in B] (6,)
        [m/s², rad/s²].
        """
        out = b""
        stamp = self.boot + t
        if t >= self._next_heartbeat - 1e-9:
            self._next_heartbeat = t + HEARTBEAT
            out += self.codec.heartbeat(self.engaged)
        if t >= self._next_state - 1e-9:
            self._next_state = max(self._next_state + STATE_PERIOD, t - STATE_PERIOD)
            f = attitude.rotate_back(x[Q], acceleration[:3] + [0.0, 0.0, self._vehicle.gravity])
            out += self.codec.inertial(stamp, f, x[W]) + self.codec.odometry(stamp, x)
            throttle = throttle_of(self._vehicle, self.in_force[0])
            if not self.handovers or t - self.handovers[-1] >= QUIET:
                out += self.codec.command(stamp, self.in_force[1:], throttle)
        return out

    def _hold(self, t: float, x: np.ndarray) -> np.ndarray:
        """Return thrust and body rates (4,) that hold the place where the hold began [N, rad/s]."""
        if self._place is None:
            self._place = x[P].copy()
            self._sum = np.zeros(3)
        off = x[P] - self._place
        self._sum = np.clip(self._sum + (t - self._stepped) * off, -1.0, 1.0)
        self._stepped = t
        a = -STIFFNESS * off - DAMPING * x[V] - INTEGRAL * self._sum
        a *= min(1.0, MOST / max(float(np.linalg.norm(a)), 1e-9))
        wanted = a + [0.0, 0.0, self._vehicle.gravity]
        rates = rates_towards(x[Q], wanted, self._loop)
        thrust = self._vehicle.mass * float(wanted @ attitude.body_z(x[Q]))
        return np.array([np.clip(thrust, 0.0, 4 * self._vehicle.max_rotor_thrust), *rates])


def throttle_of(vehicle: Vehicle, thrust: float, voltage: float | None = None) -> float:
    """Return the thrust of SET_ATTITUDE_TARGET, over that at full throttle [1].

    By the vehicle file's thrust map; linear in thrust where the file names none.

    Args:
        thrust: collective [N].
        voltage: of the battery [V]; None, or one that is far from the map's: the map's own.
    """
    curve, believed = _map(vehicle, voltage)
    return float(np.clip(curve.throttle(thrust / 4, believed), 0.0, 1.0))


def thrust_of(vehicle: Vehicle, throttle: float, voltage: float | None = None) -> float:
    """Return the collective thrust [N] of SET_ATTITUDE_TARGET's, the inverse of `throttle_of`."""
    curve, believed = _map(vehicle, voltage)
    return 4 * float(curve.thrust(throttle, believed))


def rates_towards(q: np.ndarray, z_W: np.ndarray, loop: RateLoop) -> np.ndarray:
    """Return the commanded body rates (3,) that turn body z to a direction, within the loop's
    largest [rad/s].

    Args:
        q: (4,) attitude.
        z_W: (3,) in W, of any length.
    """
    z_B = attitude.rotate_back(q, z_W / np.linalg.norm(z_W))
    axis = np.array([-z_B[1], z_B[0], 0.0])  # body z x z_B
    sine = float(np.linalg.norm(axis))
    angle = float(np.arctan2(sine, z_B[2]))
    # upside down any axis does
    turn = axis * (angle / sine) if sine > 1e-9 else np.array([angle, 0.0, 0.0])
    most = np.array(loop.max_rate)
    return np.clip(TURN * turn / np.array(loop.gain), -most, most)


def _map(vehicle: Vehicle, voltage: float | None) -> tuple[ThrottleMap, float | None]:
    """Return the thrust map of a vehicle, and the voltage where it can be that of its battery."""
    curve = vehicle.throttle or ThrottleMap(full_thrust=vehicle.max_rotor_thrust, linear=1.0)
    reference = curve.voltage
    is_far = voltage is None or reference is None or abs(voltage / reference - 1) > BELIEVED
    return curve, None if is_far else voltage
