"""State and acceleration of a vehicle from its messages, with their age; what is absurd is not
taken.
"""

import dataclasses as dc
from collections import deque

import numpy as np

from np_drake import attitude
from np_drake.offboard.codec import Battery, Command, Heartbeat, Inertial, Pose, Said
from np_drake.offboard.config import OffboardConfig
from np_drake.offboard.message_clock import MessageClock
from np_drake.rigid_body import P, Q, V, W

FORGOTTEN = 1.0  # after which a state says nothing of where the next may be [s]; source: own choice
HARDEST = (
    60.0  # specific force beyond which none flies [m/s²]; source: own choice, six times the weight
)
KEPT = 100_000  # numbers that a report reads, the last [1]; source: own choice
SPAN = 0.015  # over which body rates are differentiated [s]; source: own choice
INERTIAL = "HIGHRES_IMU"
SOURCES = (
    ("ODOMETRY",),
    ("LOCAL_POSITION_NED", "ATTITUDE_QUATERNION"),
)  # messages that make a state together
OWN = {  # entries of the state that a message has
    "ODOMETRY": np.ones(13, bool),
    "LOCAL_POSITION_NED": np.r_[np.ones(3), np.zeros(4), np.ones(3), np.zeros(3)].astype(bool),
    "ATTITUDE_QUATERNION": np.r_[np.zeros(3), np.ones(4), np.zeros(3), np.ones(3)].astype(bool),
}


@dc.dataclass(frozen=True)
class Reading:
    """What is known of the vehicle at a time; NaN where nothing is."""

    x: np.ndarray  # (13,) in W, brought to this time
    acceleration: np.ndarray  # (6,) [a in W, al in B] [m/s², rad/s²]
    in_force: (
        np.ndarray
    )  # (4,) thrust over that at full throttle, body rates, as the autopilot tells [1, rad/s]
    engaged: bool  # whether the autopilot follows what is sent
    problem: str  # that keeps it from being flown by; empty for none


class Readings:
    """What a vehicle's messages have said so far.

    Args:
        gravity: [m/s²].
    """

    def __init__(self, config: OffboardConfig, gravity: float = 9.81):
        self._config, self._gravity = config, np.array([0.0, 0.0, gravity])
        self.refused: dict[str, int] = {"late": 0, "absurd": 0}  # messages that were not taken
        self.restarts = 0  # of the autopilot
        self.voltage: float | None = None  # of the battery [V]; None: not known
        self.ages: deque[float] = deque(maxlen=KEPT)  # of the states that were read [s]
        self.autopilot = 0  # its kind, MAV_AUTOPILOT
        self._engaged, self._heard = False, -np.inf
        self._inertial: list[Inertial] = []
        self._forget()

    def take(self, said: Said, now: float) -> None:
        """Take what a message says.

        Args:
            now: our time [s].
        """
        if isinstance(said, Heartbeat):
            self._engaged, self._heard, self.autopilot = said.engaged, now, said.autopilot
        elif isinstance(said, Pose):
            self._take_pose(said, now)
        elif isinstance(said, Inertial):
            self._take_inertial(said, now)
        elif isinstance(said, Battery):
            self.voltage = said.voltage
        elif isinstance(said, Command) and np.isfinite([said.thrust, *said.rates]).all():
            self._in_force, self._in_force_at = np.array([said.thrust, *said.rates]), now

    def at(self, now: float) -> Reading:
        """Return what is known at our time [s]."""
        poses = self._newest(now)
        ages = [max(self._age(pose.kind, pose.stamp, now), 0.0) for pose in poses]
        x, age = np.full(13, np.nan), max(ages, default=np.inf)
        for pose in poses:
            own = OWN[pose.kind]
            x[own] = pose.x[own]
        x[Q] /= np.linalg.norm(x[Q])
        problem = self._problem(now, x, age)
        acceleration = np.full(6, np.nan)
        if (
            self._inertial
            and self._age(INERTIAL, self._inertial[-1].stamp, now) <= self._config.stale_after
        ):
            a = attitude.rotate(x[Q], self._inertial[-1].f) - self._gravity
            acceleration = np.concatenate([a, self._turn_rate()])
        if age < FORGOTTEN:
            self.ages.append(age)
            _bring(x, acceleration, ages[0], ages[-1])
        fresh = now - self._in_force_at <= self._config.stale_after
        in_force = self._in_force if fresh else np.full(4, np.nan)
        return Reading(x, acceleration, in_force, self._engaged, problem)

    def _newest(self, now: float) -> list[Pose]:
        """Return the message, or the two of position and attitude, that make the newest whole
        state.
        """
        best, least = list[Pose](), np.inf
        for kinds in SOURCES:
            poses = [self._poses[kind] for kind in kinds if kind in self._poses]
            age = max((self._age(pose.kind, pose.stamp, now) for pose in poses), default=np.inf)
            if len(poses) == len(kinds) and age < least:
                best, least = poses, age
        return best

    def _age(self, kind: str, stamp: float, now: float) -> float:
        return self._clocks[kind].age(stamp, now)

    def _problem(self, now: float, x: np.ndarray, age: float) -> str:
        limit = self._config.stale_after
        if now - self._heard > self._config.heartbeat_lost:
            return "no heartbeat of an autopilot"
        if not np.isfinite(x).all():
            return "no ODOMETRY, nor LOCAL_POSITION_NED with ATTITUDE_QUATERNION"
        if not age <= limit:
            return f"the state is older than {1e3 * limit:.0f} ms"
        if not self._inertial or self._age(INERTIAL, self._inertial[-1].stamp, now) > limit:
            return f"no HIGHRES_IMU for {1e3 * limit:.0f} ms"
        return ""

    def _in_turn(self, kind: str, stamp: float, now: float) -> bool:
        """Take the stamp of a message, and return whether it is newer than all before."""
        clock = self._clocks.setdefault(kind, MessageClock())
        newest = clock.newest
        if clock.hear(stamp, now):
            self.restarts += 1
            self._forget()
            self._clocks[kind] = clock
            return True
        self.refused["late"] += stamp <= newest
        return stamp > newest

    def _take_pose(self, said: Pose, now: float) -> None:
        if not self._in_turn(said.kind, said.stamp, now):
            return
        if self._absurd(said, now):
            self.refused["absurd"] += 1
            return
        self._poses[said.kind], self._taken[said.kind] = said, now

    def _absurd(self, said: Pose, now: float) -> bool:
        """Return whether a message cannot be true: not finite, no rotation, or too far from where
        it was.
        """
        own, x = OWN[said.kind], said.x
        if not np.isfinite(x[own]).all() or (own[3] and abs(np.linalg.norm(x[Q]) - 1) > 0.1):
            return True
        if own[0] and np.linalg.norm(x[V]) > 2 * self._config.max_speed:
            return True
        before, since = self._poses.get(said.kind), now - self._taken.get(said.kind, -np.inf)
        if before is None or not own[0] or since > FORGOTTEN:
            return False
        stamps = said.stamp - before.stamp
        led = before.x[P] + before.x[V] * (
            stamps if stamps <= FORGOTTEN else since
        )  # its clock may jump
        return bool(np.linalg.norm(x[P] - led) > self._config.max_jump)

    def _take_inertial(self, said: Inertial, now: float) -> None:
        if not self._in_turn(INERTIAL, said.stamp, now):
            return
        if not (
            np.linalg.norm(said.f) <= HARDEST
            and np.linalg.norm(said.w) <= 2 * self._config.max_rate
        ):
            self.refused["absurd"] += 1
            return
        kept = [one for one in self._inertial if said.stamp - one.stamp <= 2 * SPAN]
        self._inertial = [*kept, said]

    def _turn_rate(self) -> np.ndarray:
        """Return the body rates' change (3,) over `SPAN`; zero before there are two readings
        [rad/s²].
        """
        last = self._inertial[-1]
        before = [
            one for one in self._inertial if last.stamp - one.stamp >= SPAN - 1e-6
        ] or self._inertial[:1]
        span = last.stamp - before[-1].stamp
        return (last.w - before[-1].w) / span if span > 0 else np.zeros(3)

    def _forget(self) -> None:
        self._clocks: dict[str, MessageClock] = {}
        self._poses: dict[str, Pose] = {}
        self._taken: dict[str, float] = {}  # our time of each [s]
        self._inertial = []
        self._in_force, self._in_force_at = np.full(4, np.nan), -np.inf


def _bring(x: np.ndarray, acceleration: np.ndarray, moved: float, turned: float) -> None:
    """Bring a state (13,) forward, with the accelerations where they are known.

    Args:
        acceleration: (6,) [a in W, al in B] [m/s², rad/s²].
        moved: age of position and velocity [s].
        turned: age of attitude and body rates [s].
    """
    known = np.nan_to_num(acceleration)
    x[P] += moved * x[V] + 0.5 * moved**2 * known[:3]
    x[V] += moved * known[:3]
    turn = x[W] + 0.5 * turned * known[3:]
    x[Q] = attitude.multiply(x[Q], attitude.from_rotation_vector(turned * turn))
    x[W] += turned * known[3:]
