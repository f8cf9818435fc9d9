"""Node of offboard control: one tick after the other, from messages to a command."""

import dataclasses as dc

import numpy as np

from diagrams.batch.failed_run import one_line
from diagrams.loop.flight import FlightConfig
from diagrams.offboard.companion import Answer, Companion
from diagrams.offboard.flight_record import Counts, Event, FlightRecord, Flown
from diagrams.offboard.solver_thread import Worker
from np_drake.mpc.problem import MpcStatus
from np_drake.offboard.anchor import Anchor
from np_drake.offboard.codec import COMPANION, Codec, Said
from np_drake.offboard.command import rates_towards, throttle_of, thrust_of
from np_drake.offboard.limits import out_of_limits
from np_drake.offboard.link import Link
from np_drake.offboard.message_clock import NodeClock
from np_drake.offboard.phases import Phase, Phases
from np_drake.offboard.readings import Reading, Readings
from np_drake.rigid_body import Q, V, W
from np_drake.vehicle.vehicle import RateLoop

# Asked of the autopilot, at the node's rate.
ASKED = ("ODOMETRY", "LOCAL_POSITION_NED", "ATTITUDE_QUATERNION", "HIGHRES_IMU", "ATTITUDE_TARGET")
HEARTBEAT, HEARTBEATS = (
    1.0,
    10.0,
)  # between two of the node's own [s]; asked of the autopilot's [Hz]
LEAVING, LEAVES = 0.2, 3.0  # between two requests to hold, and how long they are made [s]
SLOW = 0.5  # speed above which nothing begins [m/s]; source: own choice
WARM_UP = 5  # steps before the first message [1]
LEVEL_THRUST = (0.5, 1.6)  # of level thrust over the weight [1]; source: own choice
UP = np.array([0.0, 0.0, 1.0])


class Node:
    """Reads the messages of an autopilot and commands it, while all is in order; flies once.

    Args:
        config: of the flight: reference, controller that commands body rates, vehicle, limits.
    Raises: ValueError: on a controller that does not command body rates, or whose period is no
        multiple of a tick.
    """

    def __init__(self, config: FlightConfig, link: Link, worker: Worker):
        self.config, self._limits, self._link, self._worker = (
            config,
            config.offboard.check(),
            link,
            worker,
        )
        ticks = config.controller.period * config.offboard.rate
        if abs(ticks - round(ticks)) > 1e-6 or ticks < 1 - 1e-6:
            raise ValueError(
                f"offboard: rate must be a whole multiple of the controller's, "
                f"{1 / config.controller.period:g} Hz; "
                f"got {config.offboard.rate:g}."
            )
        vehicle = config.controller.believed(config.vehicle)
        self._vehicle, self._weight = vehicle, vehicle.mass * vehicle.gravity
        self._loop = vehicle.rate_loop or RateLoop()
        self._motion, self._track = config.motion, config.motion.sample(np.zeros(1))[0, 0]
        self._codec, self._companion = Codec(COMPANION, self._limits.system), Companion(config)
        self.readings, self.clock, self._heard = (
            Readings(self._limits, vehicle.gravity),
            NodeClock(),
            list[Said](),
        )
        self.phases, self.events, self.counts, self._record = (
            Phases(),
            list[Event](),
            Counts(),
            FlightRecord(),
        )
        self.x = np.full(13, np.nan)  # state in the autopilot's local frame, z up
        self._begin: float | None = None  # time of the first tick [s]
        self._anchor: Anchor | None = None
        self._handed_over = self._next_step = self._next_heartbeat = -np.inf
        self._left_at = np.inf  # when the autopilot was asked to hold its place [s]
        self._answer: Answer | None = None
        self._generation = 0  # of the controller's memory [1]
        self._is_known = self._is_trusted = (
            False  # the state of this tick: whether it is, and within limits
        )
        self._is_owed = False  # an answer, since the period began
        self._without_answer = 0  # periods in succession [1]
        self._sent = np.array([self._weight, 0.0, 0.0, 0.0])
        self._force = np.zeros(3)
        self._error = self._problem = ""  # of the last tick that failed; what is not in order
        self._warm_up()

    @property
    def phase(self) -> Phase:
        """Phase of the flight."""
        return self.phases.phase

    @property
    def lacks(self) -> str:
        """What it waits for before it flies; empty once it does."""
        waiting = (
            self._problem
            or f"in order, and not in offboard, for less than {self._limits.settle:g} s"
        )
        return {Phase.WAITING: waiting, Phase.READY: "the pilot has not handed over"}.get(
            self.phase, ""
        )

    @property
    def leaves(self) -> bool:
        """Whether the autopilot has been asked to hold its place."""
        return self._left_at < np.inf

    @property
    def flown(self) -> Flown | None:
        """The flight so far; None where there is none."""
        return self._record.flown(self._vehicle, self.config.name)

    def flown_for(self, now: float) -> float:
        """Return the time on the reference, 0 before the autopilot has handed over [s].

        Args:
            now: our time [s].
        """
        return now - self._handed_over if self._handed_over > -np.inf else 0.0

    def leave(self, now: float) -> None:
        """Ask the autopilot to hold its place, and go on commanding until it does.

        Args:
            now: our time [s].
        """
        self._left_at, self._next_heartbeat = now, -np.inf

    def listen(self) -> list[Said]:
        """Return what has come since the last tick; the next takes it, by its time."""
        try:
            self._heard += [one for data in self._link.receive() for one in self._codec.parse(data)]
        except Exception:  # nothing may end a flight but its phases
            self.counts.errors += 1
        return self._heard

    def tick(self, now: float, patience: float = 0.0) -> None:
        """Read what has come, and send what follows; a tick that fails sends nothing, and counts as
        a problem.

        Args:
            now: our time, not before that of the last tick [s].
            patience: longest time to wait for a solve [s].
        """
        self.counts.ticks += 1
        self._begin = now if self._begin is None else self._begin
        try:
            self._tick(now, patience)
            self._error = ""
        except Exception as error:  # nothing may end a flight but its phases
            self.counts.errors += 1
            self._error = f"internal error: {one_line(error)}"
            self._change(now, self._error, self.phases.was_engaged)

    def _tick(self, now: float, patience: float) -> None:
        if not self._heard:
            self.listen()
        while self._heard:
            self.readings.take(self._heard.pop(0), now)
        reading = self.readings.at(now)
        self.x = reading.x
        self._is_trusted, problem = self._judge(now, reading)
        before = self.phase
        self._change(now, problem, reading.engaged)
        if self.phase is Phase.READY and before is not Phase.READY:
            self._anchor = Anchor.at(reading.x, self._track)
            self._companion.reset()
            self._generation += 1
            self._answer, self._without_answer, self._is_owed, self._next_step = (
                None,
                0,
                False,
                -np.inf,
            )
        elif self.phase is Phase.FLYING and before is Phase.READY:
            self._handed_over = now
        elif self.phase is Phase.LEVEL:
            self._answer = None
        if self._anchor is not None and self.phase.sends:
            x = self._anchor.seen(reading.x)
            a = np.concatenate(
                [self._anchor.turned(reading.acceleration[:3]), reading.acceleration[3:]]
            )
            self._solve(now, reading, x, a, patience)
            self._send(now, x, a)
        self._say_hello(now)

    def _judge(self, now: float, reading: Reading) -> tuple[bool, str]:
        """Return whether the state may be flown by, and what is not in order."""
        problem, phase = reading.problem, self.phase
        self._is_known = not problem
        if not problem and phase in (Phase.WAITING, Phase.READY):
            held = self._anchor if phase is Phase.READY else None
            anchor = held or Anchor.at(reading.x, self._track)
            problem = out_of_limits(anchor.seen(reading.x), self._track, self._limits)
            if not problem and np.linalg.norm(reading.x[V]) > SLOW:
                problem = f"the vehicle moves by more than {SLOW:g} m/s"
            elif not problem and not anchor.holds(reading.x, self._track):
                problem = "the vehicle has moved on"
            elif not problem and held is None and not np.isfinite(reading.in_force).all():
                problem = "no ATTITUDE_TARGET"
        elif not problem and phase.sends and self._anchor is not None:
            reference = self._motion.sample(np.array([self.flown_for(now)]))[0, 0]
            problem = out_of_limits(self._anchor.seen(reading.x), reference, self._limits)
        trusted = not problem
        if not problem and phase.sends and self._without_answer >= self._limits.late_solves:
            problem = f"no answer of the controller for {self._without_answer} periods"
        if not problem and now > self._left_at + LEAVES:
            problem = "the autopilot does not hold its place when it is asked to"
        return trusted, problem

    def _change(self, now: float, problem: str, engaged: bool) -> None:
        before, self._problem = self.phase, problem
        self.phases = self.phases.advanced(
            now, problem=problem, engaged=engaged, config=self._limits
        )
        if self.phase is not before:
            self.events.append(Event(self._since_start(now), self.phase, self.phases.reason))

    def _solve(
        self, now: float, reading: Reading, x: np.ndarray, a: np.ndarray, patience: float
    ) -> None:
        """Step the controller where a period begins, and take its answer where there is one."""
        if now >= self._next_step - 1e-9:
            period = self.config.controller.period
            self._next_step = max(self._next_step, now - period) + period
            if self._is_owed:
                self._without_answer += 1
                self.counts.late += 1
            self._is_owed = self._is_trusted
            self._begin_step(now, reading, x, a)
        found = self._found(now, patience)
        if found is None:
            return
        self.counts.solves.append(found.solve_time)
        usable = bool(np.isfinite(found.rates_thrust).all())
        self._answer = found if usable else None
        if usable and self._is_trusted and np.isfinite(found.force).all():
            self._force = found.force
        if usable and found.status < MpcStatus.SHIFTED_PLAN:
            self._without_answer, self._is_owed = 0, False

    def _begin_step(self, now: float, reading: Reading, x: np.ndarray, a: np.ndarray) -> None:
        in_force = self._sent
        if self.phase is Phase.READY and np.isfinite(reading.in_force).all():
            in_force = reading.in_force.copy()
            in_force[0] = thrust_of(self._vehicle, in_force[0], self.readings.voltage)
        measured = x if self._is_trusted else np.full(13, np.nan)
        t, generation = self.flown_for(now), self._generation
        companion, context = self._companion, self._companion.context

        def step() -> Answer:
            found = companion.step(
                t, x=measured, acceleration=a, in_force=in_force, context=context
            )
            return dc.replace(found, generation=generation)

        self._worker.submit(step, now)
        self.counts.periods += 1

    def _found(self, now: float, patience: float) -> Answer | None:
        """Return the controller's answer; None where there is none, it has failed, or it is of an
        earlier memory.
        """
        try:
            found = self._worker.answer(now, patience)
        except Exception:  # whatever a controller raises: it counts as no answer
            return None
        return found if found is not None and found.generation == self._generation else None

    def _send(self, now: float, x: np.ndarray, a: np.ndarray) -> None:
        command = self._level(x) if self._answer is None else self._answer.rates_thrust.copy()
        most = np.array(self._loop.max_rate)
        command[0] = np.clip(command[0], 0.0, 4 * self._vehicle.max_rotor_thrust)
        command[1:] = np.clip(command[1:], -most, most)
        self._sent = command
        throttle = throttle_of(self._vehicle, command[0], self.readings.voltage)
        self._link.send(self._codec.command(self._since_start(now), command[1:], throttle))
        if self.phase in (Phase.FLYING, Phase.LEVEL) and not self.leaves and self._is_trusted:
            t = self.flown_for(now)
            u = np.array([command[0], *self._loop.torque(self._vehicle.J, x[W], command[1:])])
            reference = self._motion.sample(np.array([t]))[0, 0]
            self._record.add(
                t=np.array(t), x=x, acceleration=a, u=u, rates=command[1:], reference=reference
            )

    def _level(self, x: np.ndarray) -> np.ndarray:
        """Return level thrust (4,), with the residual force that was predicted last [N, rad/s]."""
        least, most = LEVEL_THRUST
        thrust = np.clip(self._weight - self._force[2], least * self._weight, most * self._weight)
        rates = rates_towards(x[Q], UP, self._loop) if self._is_known else np.zeros(3)
        return np.array([thrust, *rates])

    def _say_hello(self, now: float) -> None:
        """Send the node's heartbeat, and ask for the messages that it needs."""
        if now < self._next_heartbeat - 1e-9:
            return
        self._next_heartbeat = now + (LEAVING if self.leaves else HEARTBEAT)
        out = self._codec.heartbeat()
        if self.leaves:
            out += self._codec.hold(self.readings.autopilot)
        elif not self.phase.sends:
            out += self._codec.request("HEARTBEAT", HEARTBEATS)
            out += b"".join(self._codec.request(name, self._limits.rate) for name in ASKED)
        self._link.send(out)

    def _since_start(self, now: float) -> float:
        return now - (now if self._begin is None else self._begin)

    def _warm_up(self) -> None:
        """Step the controller a few times at rest: what is compiled or built on first use is done
        before it matters.
        """
        x = np.array([*self._track, 1.0, *np.zeros(9)])
        for _ in range(WARM_UP):
            self._companion.step(0.0, x=x, acceleration=np.zeros(6), in_force=self._sent)
        self._companion.reset()
