"""Node of offboard control: one tick after the other, from messages to a command."""

import dataclasses as dc
from typing import NamedTuple

import numpy as np

from diagrams.loop.flight import FlightConfig
from diagrams.offboard.companion import Answer, Companion
from diagrams.offboard.solver_thread import Worker
from np_drake.flight_log import FlightLog
from np_drake.offboard.anchor import Anchor
from np_drake.offboard.codec import COMPANION, Codec
from np_drake.offboard.command import rates_towards, throttle_of, thrust_of
from np_drake.offboard.limits import out_of_limits
from np_drake.offboard.link import Link
from np_drake.offboard.phases import Phase, Phases
from np_drake.offboard.readings import Reading, Readings
from np_drake.rate_loop import RateLoop
from np_drake.rigid_body import Q, W

ASKED = ("ODOMETRY", "HIGHRES_IMU", "ATTITUDE_TARGET")  # of the autopilot, at the node's rate
HEARTBEAT = 1.0  # between two of the node's own, and between two requests [s]
WARM_UP = 5  # steps before the first message [1]
LEAVING = 0.2  # between two requests to hold [s]
LEVEL_THRUST = (0.5, 1.6)  # of level thrust over the weight [1]; source: own choice
UP = np.array([0.0, 0.0, 1.0])


class Event(NamedTuple):
    """Change of phase."""

    time: float  # since the node's start [s]
    phase: Phase
    reason: str


class Flown(NamedTuple):
    """One flight."""

    log: FlightLog
    reference: np.ndarray  # (n, 3) position where it should be [m]


@dc.dataclass
class Counts:
    """What a report tells of deadlines."""

    ticks: int = 0
    sent: int = 0
    periods: int = 0  # of the controller, while it commands
    late: int = 0  # of them without an answer in time
    skipped: int = 0  # ticks that had no time
    solves: list[float] = dc.field(default_factory=list)  # times [s]
    delays: list[float] = dc.field(default_factory=list)  # of ticks after their time [s]


class Node:
    """Reads the messages of an autopilot and commands it, while all is in order.

    Args:
        config: of the flight: reference, controller that commands body rates, vehicle, limits.
        link: to the autopilot; whoever made it closes it.
        worker: steps the controller.
    Raises: ValueError: on a controller that does not command body rates.
    """

    def __init__(self, config: FlightConfig, link: Link, worker: Worker):
        self.config, self._limits = config, config.offboard.check()
        self._link, self._worker = link, worker
        self._begin: float | None = None  # time of the first tick [s]
        vehicle = config.controller.believed(config.vehicle)
        self._vehicle, self._weight = vehicle, vehicle.mass * vehicle.gravity
        self._loop = vehicle.rate_loop or RateLoop()
        self._motion, self._track = config.motion, config.motion.sample(np.zeros(1))[0, 0]
        self._codec, self._companion = Codec(COMPANION), Companion(config)
        self.readings = Readings(self._limits, vehicle.gravity)
        self.phases, self.events, self.counts = Phases(), list[Event](), Counts()
        self._anchor: Anchor | None = None
        self._handed_over = self._next_step = self._next_heartbeat = -np.inf
        self._answer: Answer | None = None
        self._is_trusted = False  # the state of this tick
        self._without_answer = 0  # periods in succession [1]
        self._sent = np.array([self._weight, 0.0, 0.0, 0.0])
        self._force = np.zeros(3)
        self._flights: list[list[tuple[np.ndarray, ...]]] = []
        self._warm_up()
        self.leaves = False  # whether the autopilot is asked to hold its place

    def _warm_up(self) -> None:
        """Step the controller a few times at rest: what is compiled or built on first use is done before it matters."""
        x = np.array([*self._track, 1.0, *np.zeros(9)])
        for _ in range(WARM_UP):
            self._companion.step(0.0, x=x, acceleration=np.zeros(6), in_force=self._sent)
        self._companion.reset()

    @property
    def phase(self) -> Phase:
        """Phase of the flight."""
        return self.phases.phase

    def flown_for(self, now: float) -> float:
        """Return the time on the reference, 0 before the autopilot has handed over [s].

        Args:
            now: our time [s].
        """
        return now - self._handed_over if self._handed_over > -np.inf else 0.0

    def tick(self, now: float, patience: float = 0.0) -> None:
        """Read what has come, and send what follows.

        Args:
            now: our time, not before that of the last tick [s].
            patience: longest time to wait for a solve [s].
        """
        self.counts.ticks += 1
        self._begin = now if self._begin is None else self._begin
        for data in self._link.receive():
            for said in self._codec.parse(data):
                self.readings.take(said, now)
        reading = self.readings.at(now)
        x = np.full(13, np.nan) if self._anchor is None else self._anchor.seen(reading.x)
        self._advance(now, reading, x)
        if self._anchor is None or not self.phase.sends:
            self._say_hello(now)
            return
        x = self._anchor.seen(reading.x)
        self._solve(now, reading, x, patience)
        self._send(now, x, reading)
        self._say_hello(now)

    def leave(self) -> None:
        """Ask the autopilot to hold its place from now on, and go on commanding until it does."""
        self.leaves, self._next_heartbeat = True, -np.inf

    @property
    def flights(self) -> list[Flown]:
        """What was flown between a hand-over and the next, each in the axes of its reference."""
        found = []
        for rows in filter(None, self._flights):
            t, x, acceleration, u, rates, position = (np.array(column) for column in zip(*rows, strict=True))
            log = FlightLog(
                t=t[:, 0], p=x[:, :3], q=x[:, 3:7], v=x[:, 7:10], w=x[:, 10:13], u=self._vehicle.saturate(u),
                a=acceleration[:, :3], al=acceleration[:, 3:], commanded_rates=rates, name=self.config.name,
            )  # fmt: skip
            found.append(Flown(log, position))
        return found

    def _advance(self, now: float, reading: Reading, x: np.ndarray) -> None:
        """Find the phase, and follow its change."""
        before, problem = self.phase, reading.problem
        if not problem and before in (Phase.WAITING, Phase.READY):
            problem = "" if np.isfinite(reading.in_force).all() else "no ATTITUDE_TARGET"
        if not problem and before.sends:
            problem = out_of_limits(x, self._motion.sample(np.array([self.flown_for(now)]))[0, 0], self._limits)
            if before is Phase.READY and self._anchor is not None and not self._anchor.holds(reading.x, self._track):
                problem = "the vehicle has moved on"
        self._is_trusted = not problem
        if not problem and before.sends and self._without_answer >= self._limits.late_solves:
            problem = f"no answer of the controller for {self._without_answer} periods"
        self.phases = self.phases.advanced(now, problem=problem, engaged=reading.engaged, config=self._limits)
        if self.phase is before:
            return
        self.events.append(Event(self._since_start(now), self.phase, self.phases.reason))
        if self.phase in (Phase.WAITING, Phase.READY):
            self._handed_over, self._without_answer, self._answer = -np.inf, 0, None
            self._anchor, self._next_step = None, -np.inf
            if self.phase is Phase.READY:
                self._anchor = Anchor.at(reading.x, self._track)
                self._companion.reset()
        elif before is Phase.READY:
            self._handed_over = now
            self._flights.append([])

    def _solve(self, now: float, reading: Reading, x: np.ndarray, patience: float) -> None:
        """Step the controller where a period begins, and take its answer where there is one."""
        assert self._anchor is not None
        period, due = self.config.controller.period, now >= self._next_step - 1e-9
        if due:
            self._next_step = max(self._next_step, now - period) + period
            if self.phase is Phase.READY:
                in_force = reading.in_force.copy()
                in_force[0] = thrust_of(self._vehicle, in_force[0], self.readings.voltage)
            else:
                in_force = self._sent
            measured = x if self._is_trusted else np.full(13, np.nan)
            a = np.concatenate([self._anchor.turned(reading.acceleration[:3]), reading.acceleration[3:]])
            t, companion = self.flown_for(now), self._companion
            self._worker.submit(lambda: companion.step(t, x=measured, acceleration=a, in_force=in_force), now)
            self.counts.periods += 1
        found = self._found(now, patience)
        if found is not None:
            self.counts.solves.append(found.solve_time)
            if self._is_trusted and np.isfinite(found.force).all():
                self._force = found.force
            self._answer = found if np.isfinite(found.rates_thrust).all() else None
        if found is not None and found.is_usable:
            self._without_answer = 0
        elif due and self._is_trusted:
            self._without_answer += 1
            self.counts.late += 1

    def _found(self, now: float, patience: float) -> Answer | None:
        """Return the controller's answer; None where there is none, or it has failed."""
        try:
            return self._worker.answer(now, patience)
        except (ValueError, RuntimeError, ArithmeticError):  # of the controller: counts as no answer
            return None

    def _send(self, now: float, x: np.ndarray, reading: Reading) -> None:
        answer = self._answer
        levels = answer is None or self.phase is Phase.LEVEL
        command = self._level(x, reading) if levels or answer is None else answer.rates_thrust.copy()
        most = np.array(self._loop.max_rate)
        command[0] = np.clip(command[0], 0.0, 4 * self._vehicle.max_rotor_thrust)
        command[1:] = np.clip(command[1:], -most, most)
        self._sent = command
        throttle = throttle_of(self._vehicle, command[0], self.readings.voltage)
        self._link.send(self._codec.command(self._since_start(now), command[1:], throttle))
        self.counts.sent += 1
        if self.phase in (Phase.FLYING, Phase.LEVEL) and not self.leaves:
            self._record(now, x, reading, command)

    def _level(self, x: np.ndarray, reading: Reading) -> np.ndarray:
        """Return level thrust (4,), with the residual force that was predicted last [N, rad/s]."""
        least, most = LEVEL_THRUST
        thrust = np.clip(self._weight - self._force[2], least * self._weight, most * self._weight)
        known = not reading.problem and np.isfinite(x).all()
        return np.array([thrust, *(rates_towards(x[Q], UP, self._loop) if known else np.zeros(3))])

    def _since_start(self, now: float) -> float:
        return now - (now if self._begin is None else self._begin)

    def _record(self, now: float, x: np.ndarray, reading: Reading, command: np.ndarray) -> None:
        t = self.flown_for(now)
        if reading.problem or not np.isfinite(x).all():
            return
        assert self._anchor is not None
        a = np.concatenate([self._anchor.turned(reading.acceleration[:3]), reading.acceleration[3:]])
        u = np.array([command[0], *self._loop.torque(self._vehicle.J, x[W], command[1:])])
        position = self._motion.sample(np.array([t]))[0, 0]
        self._flights[-1].append((np.array([t]), x, a, u, command[1:], position))

    def _say_hello(self, now: float) -> None:
        """Send the node's heartbeat, and ask for the messages that it needs."""
        if now < self._next_heartbeat - 1e-9:
            return
        self._next_heartbeat = now + (LEAVING if self.leaves else HEARTBEAT)
        out = self._codec.heartbeat()
        if self.leaves:
            out += self._codec.hold(self.readings.autopilot)
        if not self.phase.sends:
            out += b"".join(self._codec.request(name, self._limits.rate) for name in ASKED)
        self._link.send(out)
