"""Offboard control: its limits, what is known of the vehicle from its messages and how old it is,
where the reference begins, and when the vehicle is commanded, levelled, or left to its autopilot.
"""

import dataclasses as dc
from collections import deque
from enum import Enum

import numpy as np

from np_drake import attitude
from np_drake.autopilot.mavlink import Battery, Command, Heartbeat, Inertial, Message, Pose
from np_drake.checks import require
from np_drake.files.yaml_file import POSITIVE, check_fields, number
from np_drake.rigid_body import P, Q, V, W

CLEAR = 0.1  # time in order after which a flight goes on [s]; source: own choice
AHEAD = 0.2  # turn after which a hold heads anew [rad]; source: own choice
# Commands in force that are alike, and those in succession that show whose they are.
# [1, rad/s], [1]; source: own choice, 1000 times a float's resolution
ALIKE = 1e-4
FOLLOWED = 3
# of the period that is asked for, by which a command may be older than what the vehicle feels
AS_FELT = 0.9  # [1]; source: own choice, less than a whole one
FORGOTTEN = 1.0  # after which a state says nothing of where the next may be [s]; source: own choice
# specific force beyond which none flies [m/s²]; source: own choice, six times the weight
HARDEST = 60.0
KEPT = 100_000  # numbers that a report reads, the last [1]; source: own choice
SPAN = 0.015  # over which body rates are differentiated [s]; source: own choice
# messages that make a state together
SOURCES = (("ODOMETRY",), ("LOCAL_POSITION_NED", "ATTITUDE_QUATERNION"))
ENTRIES = {  # entries of the state that a message has
    "ODOMETRY": np.ones(13, bool),
    "LOCAL_POSITION_NED": np.repeat([True, False, True, False], [3, 4, 3, 3]),
    "ATTITUDE_QUATERNION": np.repeat([False, True, False, True], [3, 4, 3, 3]),
}
# over which the quickest message is looked for, and as long again [s]; source: own choice
WINDOW = 5.0
# by which a stamp goes back where its sender has started anew [s]; source: own choice
RESTART = 1.0
# by which a node may be ahead of a simulated vehicle [s]; source: its messages come at 100 Hz
SLACK = 0.01
MEASURED = 1.0  # over which the rate of a vehicle's clock is measured [s]; own choice
PATIENCE = 1.0  # silence of a simulated vehicle after which it is not waited for [s]; own choice


@dc.dataclass
class OffboardConfig:
    """What must hold while the vehicle is commanded, and what happens when it does not."""

    system: int = number(0, "1", 0, 255)  # MAV_SYS_ID of the autopilot; 0: that heard first
    rate: float = number(100.0, "Hz", 2.0, 500.0)  # of what is sent
    stale_after: float = number(0.1, "s", POSITIVE)  # age of a state that is too old
    heartbeat_lost: float = number(3.0, "s", POSITIVE)  # time without one: no autopilot is there
    margin: float = number(1.0, "m", POSITIVE)  # largest distance from the reference
    max_speed: float = number(8.0, "m/s", POSITIVE)  # of the vehicle
    max_tilt: float = number(1.2, "rad", POSITIVE)  # of body z from world z
    max_rate: float = number(12.0, "rad/s", POSITIVE)  # of the body
    # of a position from where its velocity led; a message beyond is not taken
    max_jump: float = number(0.3, "m", POSITIVE)
    late_solves: int = number(5, "1", POSITIVE)  # in succession that are too many
    settle: float = number(1.0, "s", POSITIVE)  # time in order before the hand-over
    level: float = number(0.5, "s", POSITIVE)  # longest level thrust, before nothing is sent

    def check(self) -> "OffboardConfig":
        """Return self after checking all values.

        Raises: ValueError: where one is impossible.
        """
        check_fields(self, "offboard")
        require(
            self.level > CLEAR,
            f"offboard: level must be more than {CLEAR:g} s; got {self.level:g}.",
        )
        require(
            self.stale_after >= 2 / self.rate,
            f"offboard: stale_after must be two periods of {1 / self.rate:g} s at "
            f"least; got {self.stale_after:g}.",
        )
        return self


@dc.dataclass
class MessageClock:
    """Offset of a sender's clock, from the message that took least time on its way in the last 5 to
    10 s.

    A delay that every message has is not seen.
    """

    newest: float = -np.inf  # of the stamps [s]
    _least: float = np.inf  # offset of this window: our time less a stamp [s]
    _before: float = np.inf  # of the window before [s]
    _ends: float = -np.inf  # of this window, our time [s]

    def hear(self, stamp: float, now: float) -> bool:
        """Take a message's stamp by the sender's clock at our time [s]; return whether its sender
        has started anew.
        """
        restarted = stamp < self.newest - RESTART
        if restarted:
            self.newest = stamp
            self._ends = -np.inf
        if now >= self._ends:
            self._before = self._least if now < self._ends + WINDOW else np.inf
            self._least = np.inf
            self._ends = now + WINDOW
        self._least, self.newest = min(self._least, now - stamp), max(self.newest, stamp)
        return restarted

    def age(self, stamp: float, now: float) -> float:
        """Return the age at our time of a message with a stamp by the sender's clock [s]."""
        return now - (stamp + min(self._least, self._before))


@dc.dataclass
class NodeClock:
    """Time of a node: our clock, which waits for that of a vehicle that says that it is simulated.

    A simulated vehicle is as fast as its machine: all times of a node, those of its limits among
    them, are then the vehicle's. For any other vehicle they are ours.
    """

    waits: bool = False  # for the vehicle, which is simulated
    rate: float = np.nan  # of the vehicle's clock over ours, as measured last [1]
    _lag: float = 0.0  # our clock less this one [s]
    _offset: float = 0.0  # this clock less a stamp [s]
    _newest: float = -np.inf  # stamp [s]
    _moved: float = -np.inf  # when that came, by our clock [s]
    # Beginning of the measurement of the rate: our clock, stamp [s].
    _since: tuple[float, float] = (np.inf, 0.0)

    def read(self, ours: float, messages: list[Message]) -> float:
        """Return the time, at one by our clock that is not before that of the last call [s]."""
        now = ours - self._lag
        for one in messages:
            if isinstance(one, Heartbeat):
                self.waits = one.simulated
            elif (
                isinstance(one, Pose | Inertial) and not 0.0 <= self._newest - one.stamp <= RESTART
            ):
                if abs(one.stamp - self._newest) > RESTART:
                    self._offset = now - one.stamp
                    self._since = (ours, one.stamp)
                self._newest = one.stamp
                self._moved = ours
        if self.waits and ours - self._moved < PATIENCE:
            theirs = self._newest + self._offset
            now = min(max(now, theirs), theirs + SLACK)
        else:
            self._offset = now - self._newest
        self._lag = ours - now
        if ours - self._since[0] >= MEASURED:
            self.rate = (self._newest - self._since[1]) / (ours - self._since[0])
            self._since = (ours, self._newest)
        return now


@dc.dataclass(frozen=True)
class Reading:
    """What is known of the vehicle at a time; NaN where nothing is."""

    x: np.ndarray  # (13,) in W, brought to this time
    acceleration: np.ndarray  # (6,) [a in W, al in B] [m/s², rad/s²]
    # (4,) thrust over that at full throttle, body rates, as the autopilot tells [1, rad/s]
    in_force: np.ndarray
    as_felt: bool  # whether that is as new as the acceleration
    problem: str  # that keeps it from being flown by; empty for none


class Readings:
    """What a vehicle's messages have said so far, with gravity in [m/s²]."""

    def __init__(self, config: OffboardConfig, gravity: float = 9.81):
        self._config = config
        self._gravity = np.array([0.0, 0.0, gravity])
        self.refused = {"late": 0, "absurd": 0}  # messages that were not taken
        self.restarts = 0  # of the autopilot
        self.voltage: float | None = None  # of the battery [V]; None: not known
        self.ages: deque[float] = deque(maxlen=KEPT)  # of the states that were read [s]
        self.autopilot = 0  # its kind, MAV_AUTOPILOT
        self.engaged = False  # whether the autopilot follows what is sent
        self._heard = -np.inf
        # throttle and body rates (4,) that were sent last [1, rad/s]
        self.sent: deque[np.ndarray] = deque(maxlen=round(config.rate))
        self._forget()

    def _forget(self) -> None:
        self._clocks: dict[str, MessageClock] = {}
        self._poses: dict[str, Pose] = {}
        self._taken: dict[str, float] = {}  # our time of each [s]
        self._inertial: list[Inertial] = []
        self._command = Command(np.full(3, np.nan), np.nan)
        self._command_at = -np.inf
        self._alike = 0

    def take(self, message: Message, now: float) -> None:
        """Take what a message says, at our time [s]."""
        if isinstance(message, Heartbeat):
            self.engaged = message.engaged
            self._heard = now
            self.autopilot = message.autopilot
        elif isinstance(message, Battery):
            self.voltage = message.voltage
        elif isinstance(message, Pose | Inertial | Command) and self._in_turn(message, now):
            if self._is_absurd(message, now):
                self.refused["absurd"] += 1
            elif isinstance(message, Command):
                self._compare(message.values)
                self._command = message
                self._command_at = now
            elif isinstance(message, Pose):
                self._poses[message.kind] = message
                self._taken[message.kind] = now
            else:
                kept = [one for one in self._inertial if message.stamp - one.stamp <= 2 * SPAN]
                self._inertial = [*kept, message]

    def at(self, now: float) -> Reading:
        """Return what is known at our time [s]."""
        poses = self._newest(now)
        ages = [max(self._age(pose, now), 0.0) for pose in poses]
        x = np.full(13, np.nan)
        age = max(ages, default=np.inf)
        acceleration = np.full(6, np.nan)
        for pose in poses:
            x = np.where(np.isnan(pose.x), x, pose.x)
        x[Q] /= np.linalg.norm(x[Q])
        limit = self._config.stale_after
        problem = ""
        is_felt = bool(self._inertial) and self._age(self._inertial[-1], now) <= limit
        if now - self._heard > self._config.heartbeat_lost:
            problem = "no heartbeat of an autopilot"
        elif not np.isfinite(x).all():
            problem = "no ODOMETRY, nor LOCAL_POSITION_NED with ATTITUDE_QUATERNION"
        elif not age <= limit:
            problem = f"the state is older than {1e3 * limit:.0f} ms"
        elif not is_felt:
            problem = f"no HIGHRES_IMU for {1e3 * limit:.0f} ms"
        if is_felt:
            a = attitude.rotate(x[Q], self._inertial[-1].f) - self._gravity
            acceleration = np.concatenate([a, self._turn_rate()])
        if age < FORGOTTEN:
            self.ages.append(age)
            _bring(x, np.nan_to_num(acceleration), ages[0], ages[-1])
        in_force = np.full(4, np.nan)
        as_felt = False
        if now - self._command_at <= limit:
            in_force = self._command.values
            as_felt = is_felt and (
                self._age(self._command, now) - self._age(self._inertial[-1], now)
                < AS_FELT / self._config.rate
            )
        return Reading(x, acceleration, in_force, as_felt, problem)

    def _compare(self, new: np.ndarray) -> None:
        """Take the vehicle as handed over where the commands in force change as those sent do."""
        is_same = np.abs(new - self._command.values).max() <= ALIKE
        if self.engaged or not self.sent or is_same:
            return
        is_ours = np.abs(np.array(self.sent) - new).max(axis=1).min() <= ALIKE
        self._alike = self._alike + 1 if is_ours else 0
        self.engaged = self._alike >= FOLLOWED

    def _newest(self, now: float) -> list[Pose]:
        """Return the message, or the two of position and attitude, that make the newest whole
        state.
        """
        complete = [kinds for kinds in SOURCES if self._poses.keys() >= set(kinds)]
        groups = [[self._poses[kind] for kind in kinds] for kinds in complete]
        return min(groups, key=lambda poses: max(self._age(one, now) for one in poses), default=[])

    def _age(self, message: Pose | Inertial | Command, now: float) -> float:
        return self._clocks[message.kind].age(message.stamp, now)

    def _in_turn(self, message: Pose | Inertial | Command, now: float) -> bool:
        """Take the stamp of a message, and return whether it is newer than all before."""
        clock = self._clocks.setdefault(message.kind, MessageClock())
        newest = clock.newest
        if clock.hear(message.stamp, now):
            self.restarts += 1
            self._forget()
            self._clocks[message.kind] = clock
            return True
        self.refused["late"] += message.stamp <= newest
        return message.stamp > newest

    def _is_absurd(self, message: Pose | Inertial | Command, now: float) -> bool:
        """Return whether a message cannot be true: not finite, beyond what flies, no rotation, or
        too far from where it was.
        """
        if isinstance(message, Command):
            return not np.isfinite(message.values).all()
        if isinstance(message, Inertial):
            fastest = 2 * self._config.max_rate
            soft = np.linalg.norm(message.f) <= HARDEST
            return not (soft and np.linalg.norm(message.w) <= fastest)
        entries = ENTRIES[message.kind]
        x = message.x
        is_turned = entries[3] and abs(np.linalg.norm(x[Q]) - 1) > 0.1
        if is_turned or not np.isfinite(x[entries]).all():
            return True
        if entries[0] and np.linalg.norm(x[V]) > 2 * self._config.max_speed:
            return True
        before = self._poses.get(message.kind)
        since = now - self._taken.get(message.kind, -np.inf)
        if before is None or not entries[0] or since > FORGOTTEN:
            return False
        stamps = message.stamp - before.stamp  # by its clock, which may jump
        led = before.x[P] + before.x[V] * (stamps if stamps <= FORGOTTEN else since)
        return bool(np.linalg.norm(x[P] - led) > self._config.max_jump)

    def _turn_rate(self) -> np.ndarray:
        """Return the body rates' change (3,) over `SPAN`; zero before there are two readings
        [rad/s²].
        """
        last = self._inertial[-1]
        far = [one for one in self._inertial if last.stamp - one.stamp >= SPAN - 1e-6]
        before = (far or self._inertial[:1])[-1]
        span = last.stamp - before.stamp
        return (last.w - before.w) / span if span > 0 else np.zeros(3)


def _bring(x: np.ndarray, acceleration: np.ndarray, moved: float, turned: float) -> None:
    """Bring a state (13,) forward, with [a in W, al in B] (6,), by the age of position and velocity
    and that of attitude and body rates [s].
    """
    x[P] += moved * x[V] + 0.5 * moved**2 * acceleration[:3]
    x[V] += moved * acceleration[:3]
    turn = x[W] + 0.5 * turned * acceleration[3:]
    x[Q] = attitude.multiply(x[Q], attitude.from_rotation_vector(turned * turn))
    x[W] += turned * acceleration[3:]


def out_of_limits(x: np.ndarray, reference: np.ndarray, config: OffboardConfig) -> str:
    """Return which limit a state (13,) is beyond, beside the position (3,) where it should be [m];
    empty for none.
    """
    lengths = np.linalg.norm([x[P] - reference, x[V], x[W]], axis=1)
    tilt = float(np.arccos(np.clip(attitude.body_z(x[Q])[2], -1.0, 1.0)))
    for name, value, most, unit in (
        ("distance from the reference", lengths[0], config.margin, "m"),
        ("speed", lengths[1], config.max_speed, "m/s"),
        ("tilt", tilt, config.max_tilt, "rad"),
        ("body rate", lengths[2], config.max_rate, "rad/s"),
    ):
        if not value <= most:
            return f"{name} {value:.3g} {unit}, limit {most:g}"
    return ""


@dc.dataclass(frozen=True)
class Anchor:
    """Frame T of a track in the autopilot's local frame W: z up, yaw of the vehicle, start of the
    track at it.
    """

    p_WT: np.ndarray  # (3,) [m]
    q_TW: np.ndarray  # (4,), a turn about z

    @classmethod
    def at(cls, x: np.ndarray, start: np.ndarray) -> "Anchor":
        """Return the frame in which a vehicle in a state (13,) of W stands at the start (3,) of the
        track [m], heading along x.
        """
        half = _yaw(x[Q]) / 2
        q_WT = np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
        return cls(x[P] - attitude.rotate(q_WT, start), attitude.conjugate(q_WT))

    def following(self, x: np.ndarray, start: np.ndarray) -> "Anchor":
        """Return the frame in which a vehicle in a state (13,) of W is at the start (3,) of the
        track [m], with the same axes while it still heads along x.
        """
        if abs(_yaw(self.seen(x)[Q])) > AHEAD:
            return Anchor.at(x, start)
        return Anchor(x[P] - attitude.rotate_back(self.q_TW, start), self.q_TW)

    def seen(self, x: np.ndarray) -> np.ndarray:
        """Return a state (13,) of W in T."""
        q = attitude.multiply(self.q_TW, x[Q])
        return np.concatenate([self.turned(x[P] - self.p_WT), q, self.turned(x[V]), x[W]])

    def turned(self, r_W: np.ndarray) -> np.ndarray:
        """Return a free vector (3,) of W in T."""
        return attitude.rotate(self.q_TW, r_W)


def _yaw(q: np.ndarray) -> float:
    w, x, y, z = q
    return float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


class Phase(Enum):
    """What is sent."""

    WAITING = "waiting"  # nothing, until all is in order
    READY = "ready"  # a hold wherever the vehicle is; the autopilot has not handed over
    FLYING = "flying"  # the controller's commands
    LEVEL = "level"  # level thrust
    STOPPED = "stopped"  # nothing, for good

    @property
    def sends(self) -> bool:
        """Whether anything is sent."""
        return self not in (Phase.WAITING, Phase.STOPPED)


@dc.dataclass(frozen=True)
class Phases:
    """Phase of a flight and the times that lead to the next; a new one waits.

    WAITING -> READY after `settle` in order, with the autopilot in a mode of its own: a vehicle
    that is in offboard already is not taken. READY -> FLYING as it is handed over. READY and FLYING
    -> LEVEL on a problem: a vehicle may have been handed over before its heartbeat tells. LEVEL ->
    back once it is over; or, `level` seconds after it began, STOPPED, or WAITING where nobody has
    handed over. A problem that returns within `settle` goes on with the same time. A flight ->
    STOPPED as the autopilot leaves offboard. There is one: an autopilot whose failsafe is over may
    be in offboard again, with nobody having handed over.
    """

    phase: Phase = Phase.WAITING
    reason: str = ""  # of the last change
    in_order_since: float = np.inf  # [s]
    # beginning of the problem, kept for `settle` after its end [s]
    fault_since: float = np.inf
    handed_over: bool = False

    def advanced(
        self, now: float, *, problem: str, engaged: bool, config: OffboardConfig
    ) -> "Phases":
        """Return what follows at a time, not before that of the last call [s].

        Args:
            engaged: whether the autopilot is armed and follows what is sent.
        """
        since = np.inf if problem else min(self.in_order_since, now)
        in_order = 0.0 if problem else now - since
        phase, reason = self._next(now, problem, engaged, in_order, config)
        fault = min(self.fault_since, now) if phase is Phase.LEVEL else self.fault_since
        settled = phase is not Phase.LEVEL and in_order >= config.settle
        if phase is Phase.WAITING or settled:
            fault = np.inf
        handed_over = self.handed_over or (phase.sends and engaged)
        reason = self.reason if phase is self.phase else reason
        return Phases(phase, reason, since, fault, handed_over)

    def _next(
        self, now: float, problem: str, engaged: bool, in_order: float, config: OffboardConfig
    ) -> tuple[Phase, str]:
        phase = self.phase
        over = now - self.fault_since >= config.level - 1e-9
        if phase is Phase.WAITING and not engaged and not problem and in_order >= config.settle:
            return Phase.READY, "all is in order"
        if not phase.sends:
            return phase, ""
        if self.handed_over and not engaged:
            return Phase.STOPPED, "the autopilot has taken over"
        if over and (problem or phase is Phase.LEVEL):
            return Phase.STOPPED if engaged else Phase.WAITING, problem or self.reason
        if problem:
            return Phase.LEVEL, problem
        if phase is Phase.READY and engaged:
            return Phase.FLYING, "the autopilot has handed over"
        if phase is Phase.LEVEL and in_order >= CLEAR - 1e-9:
            return Phase.FLYING if engaged else Phase.READY, "in order again"
        return phase, ""
