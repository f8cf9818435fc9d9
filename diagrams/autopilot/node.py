"""Node of offboard control: estimator, predictor and MPC as they run beside a vehicle, one tick
after the other, from messages to a command; its real time and its report, and a simulated flight
that it commands.
"""

import contextlib
import dataclasses as dc
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from queue import Empty, SimpleQueue
from threading import Thread
from types import FrameType
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import PassThrough

from diagrams.batch.run import Table, one_line
from diagrams.loop.controllers import add_controller
from diagrams.loop.flight import FlightConfig
from np_drake import attitude, metrics
from np_drake.autopilot.mavlink import COMPANION, Codec, MavlinkLink, Message
from np_drake.autopilot.offboard import (
    KEPT,
    Anchor,
    NodeClock,
    Phase,
    Phases,
    Reading,
    Readings,
    out_of_limits,
)
from np_drake.autopilot.simulated import rates_towards, throttle_of, thrust_of
from np_drake.checks import require
from np_drake.flight_log import FlightLog
from np_drake.mpc.problem import MpcStatus
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop
from systems.offboard_autopilot import OffboardAutopilot

# Asked of the autopilot, at the node's rate.
ASKED = ("ODOMETRY", "LOCAL_POSITION_NED", "ATTITUDE_QUATERNION", "HIGHRES_IMU", "ATTITUDE_TARGET")
# between two of the node's own [s]; asked of the autopilot's [Hz]
HEARTBEAT = 1.0
HEARTBEATS = 10.0
# between two requests to hold, and how long they are made [s]
LEAVING = 0.2
LEAVES = 3.0
SLOW = 0.5  # speed above which nothing begins [m/s]; source: own choice
WARM_UP = 5  # steps before the first message [1]
LEVEL_THRUST = np.array([0.5, 1.6])  # of level thrust over the weight [1]; source: own choice
PATIENCE = 0.7  # share of a tick that a solve may take [1]; source: own choice
# share of the periods of `settle` that may lack an answer [1]; source: own choice
LATE = 0.5
HEIGHT_KEPT = 0.3  # over which the thrust that holds height is averaged [s]; source: own choice
LOOKS = 0.5  # between two calls of the monitor [s]


def make_companion_diagram(config: FlightConfig) -> Diagram:
    """Return the controller of a flight, without its vehicle, with input ports for what is
    measured.

    | port | size | meaning | unit |
    |---|---|---|---|
    | x | 13 | measured state | |
    | acceleration | 6 | measured [a in W, al in B] | m/s², rad/s² |
    | in_force | 4 | collective thrust and body rates that the autopilot follows | N, rad/s |
    | rates_thrust | 4 | what it is to follow | N, rad/s |
    Raises: ValueError: where it does not.
    """
    require(
        config.controller.mpc.command == "rates",
        f"{config.name}: controller.mpc.command must be rates beside an autopilot; got rotors.",
    )
    builder = DiagramBuilder()
    wires = DiagramBuilder()
    sizes = {"x": 13, "acceleration": 6, "in_force": 4}
    for name, size in sizes.items():
        wire = wires.AddNamedSystem(name, PassThrough(size))
        wires.ExportInput(wire.get_input_port(), name)
        wires.ExportOutput(wire.get_output_port(), name)
    sensors = builder.AddNamedSystem("sensors", wires.Build())
    for name in sizes:
        builder.ExportInput(sensors.GetInputPort(name), name)
    ports = add_controller(builder, config.controller, config.vehicle, config.motion, sensors)
    for name, port in ports.items():
        builder.ExportOutput(port, name)
    companion = builder.Build()
    # an answer counts as late by the node's clock, and is used all the same
    companion.GetSubsystemByName("np_mpc").controller.deadline = np.inf
    return companion


@dc.dataclass(frozen=True)
class Answer:
    """What the controller says of one instant."""

    rates_thrust: np.ndarray  # (4,) collective thrust and body rates [N, rad/s]
    status: MpcStatus
    solve_time: float  # [s]
    context: Context  # the memory that it is of


def answer_of(companion: Diagram, context: Context, t: float, **measured: np.ndarray) -> Answer:
    """Tell the companion Diagram the measurements of an instant and return what to do.

    Args:
        context: memory of what was measured before.
        t: time on the reference [s].
        measured: x (13,) in the axes of the reference, NaN where nothing is measured; acceleration
            (6,), [a in these axes, al in B]; in_force (4,), collective thrust and body rates since
            the last instant [m/s², rad/s², N, rad/s].
    """
    context.SetTime(t)
    for name, value in measured.items():
        companion.GetInputPort(name).FixValue(context, value)
    context.SetDiscreteState(companion.EvalUniquePeriodicDiscreteUpdate(context))

    def read(name: str) -> np.ndarray:
        return companion.GetOutputPort(name).Eval(context)

    return Answer(
        rates_thrust=read("rates_thrust"),
        status=MpcStatus(int(read("status")[0])),
        solve_time=float(read("solve_time")[0]),
        context=context,
    )


class SolverThread:
    """Steps the controller in a thread, one step at a time, so that a solve that takes too long
    stops nothing else, nor the end of the process.
    """

    def __init__(self) -> None:
        self._steps: SimpleQueue[Callable[[], Answer] | None] = SimpleQueue()
        self._answers: SimpleQueue[Answer | None] = SimpleQueue()
        self._is_busy = False
        Thread(target=self._work, name="companion", daemon=True).start()

    def submit(self, step: Callable[[], Answer]) -> None:
        """Begin a step; nothing is begun while the last goes on."""
        if not self._is_busy:
            self._is_busy = True
            self._steps.put(step)

    def answer(self, patience: float) -> Answer | None:
        """Return the answer of the last step, once; None where there is none after a time [s], or
        the step has failed.
        """
        with contextlib.suppress(Empty):
            answer = self._answers.get(timeout=patience if self._is_busy else 0.0)
            self._is_busy = False
            return answer
        return None

    def close(self) -> None:
        """End it, without waiting for a step that hangs."""
        self._steps.put(None)

    def _work(self) -> None:
        while (step := self._steps.get()) is not None:
            try:
                self._answers.put(step())
            except Exception:  # whatever a controller raises: it counts as no answer
                self._answers.put(None)


class Node:
    """Reads the messages of an autopilot and commands it, while all is in order; flies once.

    Args:
        config: of the flight: reference, controller that commands body rates, vehicle, limits.
    Raises: ValueError: on a controller that does not command body rates, or whose period is no
        multiple of a tick.
    """

    def __init__(self, config: FlightConfig, link: MavlinkLink, worker: SolverThread):
        self.config = config
        self._limits = config.offboard.check()
        self._motion = config.motion
        self._link = link
        self._worker = worker
        ticks = config.controller.period * config.offboard.rate
        require(
            abs(ticks - round(ticks)) <= 1e-6 and ticks >= 1 - 1e-6,
            f"offboard: rate must be a whole multiple of the controller's, "
            f"{1 / config.controller.period:g} Hz; "
            f"got {config.offboard.rate:g}.",
        )
        vehicle = config.controller.believed(config.vehicle)
        self._vehicle = vehicle
        self._weight = vehicle.mass * vehicle.gravity
        self._loop = vehicle.rate_loop or RateLoop()
        self._codec = Codec(COMPANION, self._limits.system)
        self._companion = make_companion_diagram(config)
        self._memory = self._companion.CreateDefaultContext()
        self.readings = Readings(self._limits, vehicle.gravity)
        self.clock = NodeClock()
        # ticks, those that had no time, and those that failed; the controller's periods, and those
        # without an answer until the next
        self.counts = dict.fromkeys(("ticks", "skipped", "periods", "late", "errors"), 0)
        # times of solves, and of ticks after their time [s]
        self.solves = deque[float](maxlen=KEPT)
        self.delays = deque[float](maxlen=KEPT)
        # changes of phase: since the first tick [s], to which, and why
        self.phases = Phases()
        self.events = list[tuple[float, Phase, str]]()
        self._heard = list[Message]()
        self._rows = list[tuple[np.ndarray, ...]]()
        self.x = np.full(13, np.nan)  # state in the autopilot's local frame, z up
        self._begin = np.inf  # time of the first tick [s]
        at_rest = np.array([*self._place(0.0), 1.0, *np.zeros(9)])
        self._anchor = Anchor.at(at_rest, self._place(0.0))  # until there is one
        self._axes = self._anchor.q_TW  # that the memory is in
        self._next_step = self._next_heartbeat = -np.inf
        # when the autopilot handed over, and was asked to hold its place [s]
        self._handed_over = self._left_at = np.inf
        self.flown_for = 0.0  # time on the reference, 0 before the autopilot has handed over [s]
        self._answer: Answer | None = None
        # the state of this tick: whether it is, and within limits
        self._is_known = self._is_trusted = False
        self._is_owed = False  # an answer, since the period began
        self._without_answer = 0  # periods in succession [1]
        # whether each period of the last `settle` lacked an answer
        self._late = deque[bool](maxlen=round(self._limits.settle / config.controller.period) or 1)
        self._sent = np.array([self._weight, 0.0, 0.0, 0.0])
        # that holds height [N]; what is not in order
        self._lift = self._weight
        self._problem = ""
        # what is compiled or built on first use is done before it matters
        measured = {"x": at_rest, "acceleration": np.zeros(6), "in_force": self._sent}
        for _ in range(WARM_UP):
            answer_of(self._companion, self._memory, 0.0, **measured)

    @property
    def phase(self) -> Phase:
        """Phase of the flight."""
        return self.phases.phase

    @property
    def lacks(self) -> str:
        """What it waits for before it flies; empty once it does."""
        settling = f"in order, and not in offboard, for less than {self._limits.settle:g} s"
        waiting = {
            Phase.WAITING: self._problem or settling,
            Phase.READY: "the pilot has not handed over",
        }
        return waiting.get(self.phase, "")

    @property
    def leaves(self) -> bool:
        """Whether the autopilot has been asked to hold its place."""
        return self._left_at < np.inf

    @property
    def flown(self) -> FlightLog | None:
        """The flight so far, in the axes of its reference; None where there are no two rows."""
        if len(self._rows) < 2:
            return None
        t, x, acceleration, u, rates = map(np.array, zip(*self._rows, strict=True))
        return FlightLog(
            t=t,
            p=x[:, P],
            q=x[:, Q],
            v=x[:, V],
            w=x[:, W],
            u=self._vehicle.saturate(u),
            a=acceleration[:, :3],
            al=acceleration[:, 3:],
            commanded_rates=rates,
            name=self.config.name,
        )

    def leave(self, now: float) -> None:
        """Ask the autopilot at our time [s] to hold its place, and go on commanding until it
        does.
        """
        self._left_at = now
        self._next_heartbeat = -np.inf

    def is_over(self, now: float) -> bool:
        """Return whether nothing more is sent: it has stopped, or leaves and nobody has handed over
        by our time [s], of which the next heartbeat tells.
        """
        waits = self.phase is Phase.WAITING or now > self._left_at + HEARTBEAT
        unused = self.leaves and waits and not self.phases.handed_over
        return self.phase is Phase.STOPPED or unused

    def listen(self) -> list[Message]:
        """Return what has come since the last tick; the next takes it, by its time."""
        try:
            self._heard += [one for data in self._link.receive() for one in self._codec.parse(data)]
        except Exception:  # nothing may end a flight but its phases
            self.counts["errors"] += 1
        return self._heard

    def tick(self, now: float, patience: float = 0.0) -> None:
        """Read what has come, and send what follows; a tick that fails sends nothing, and counts as
        a problem.

        Args:
            now: our time, not before that of the last tick [s].
            patience: longest time to wait for a solve [s].
        """
        self.counts["ticks"] += 1
        self._begin, self.flown_for = min(self._begin, now), max(now - self._handed_over, 0.0)
        try:
            self._tick(now, patience)
        except Exception as error:  # nothing may end a flight but its phases
            self.counts["errors"] += 1
            self._change(now, f"internal error: {one_line(error)}")

    def _tick(self, now: float, patience: float) -> None:
        heard = self.listen()
        self._heard = []
        for message in heard:
            self.readings.take(message, now)
        reading = self.readings.at(now)
        start = self._place(0.0)
        self.x = reading.x
        self._is_known = not reading.problem
        if self._is_known and self.phase is Phase.WAITING and not self._is_trusted:
            self._anchor = Anchor.at(reading.x, start)
        elif self._is_known and self._handed_over == np.inf:
            self._anchor = self._anchor.following(reading.x, start)
        problem = reading.problem or self._out_of_order(reading)
        self._is_trusted = not problem
        self._change(now, problem or self._too_late(now))
        if self._is_trusted and self._anchor.q_TW is not self._axes:
            # forget all that was measured; a step that goes on meanwhile does not count
            self._axes = self._anchor.q_TW
            self._memory = self._companion.CreateDefaultContext()
            self._answer = None
            self._next_step = -np.inf
            self._without_answer = 0
            self._is_owed = False
        if self.phase is Phase.LEVEL:
            self._answer = None
        elif self.phase is Phase.FLYING and np.linalg.norm(reading.x[V]) <= SLOW:
            self._handed_over = min(self._handed_over, now)
        if self.phase.sends or (self.phase is Phase.WAITING and self._is_trusted):
            a_W, al = np.split(reading.acceleration, 2)
            x = self._anchor.seen(reading.x)
            a = np.concatenate([self._anchor.turned(a_W), al])
            self._solve(now, reading, x, a, patience)
            if self.phase.sends:
                self._send(now, x, a)
        self._say_hello(now)

    def _out_of_order(self, reading: Reading) -> str:
        """Return why a state that is known may not be flown by; empty where it may."""
        if self.phase is Phase.STOPPED:
            return ""
        x = self._anchor.seen(reading.x)
        beyond = out_of_limits(x, self._place(self.flown_for), self._limits)
        if beyond or self.phase is not Phase.WAITING:
            return beyond
        if np.linalg.norm(x[V]) > SLOW:
            return f"the vehicle moves by more than {SLOW:g} m/s"
        return "" if np.isfinite(reading.in_force).all() else "no ATTITUDE_TARGET"

    def _too_late(self, now: float) -> str:
        """Return who does not answer in time, the controller or an autopilot that is left."""
        late = sum(self._late)
        most = self._late.maxlen or 1
        if self.phase is Phase.WAITING and late > LATE * most:
            return f"this machine is too slow: {late} of the last {most} solves were late"
        if self._without_answer >= self._limits.late_solves:
            return f"no answer of the controller for {self._without_answer} periods"
        is_left = now > self._left_at + LEAVES
        return "the autopilot does not hold its place when it is asked to" if is_left else ""

    def _place(self, t: float) -> np.ndarray:
        """Return where the vehicle should be (3,) at a time on the reference [m, s]."""
        return self._motion.sample(np.array([t]))[0, 0]

    def _change(self, now: float, problem: str) -> None:
        before = self.phase
        self._problem = problem
        self.phases = self.phases.advanced(
            now, problem=problem, engaged=self.readings.engaged, config=self._limits
        )
        if self.phase is not before:
            self.events.append((now - self._begin, self.phase, self.phases.reason))

    def _solve(
        self, now: float, reading: Reading, x: np.ndarray, a: np.ndarray, patience: float
    ) -> None:
        """Step the controller where a period begins, and take its answer where there is one."""
        period = self.config.controller.period
        if now >= self._next_step - 1e-9:
            missed = (now - self._next_step) / period if self._next_step > -np.inf else 0.0
            self._late.extend([self._is_owed, *int(min(missed, 1 / period)) * [True]])
            self._next_step = max(self._next_step, now - period) + period
            self._without_answer += self._is_owed
            self.counts["late"] += self._is_owed
            self._is_owed = self._is_trusted
            self._begin_step(reading, x, a)
        answer = self._worker.answer(patience)
        if answer is None or answer.context is not self._memory:
            return
        self.solves.append(answer.solve_time)
        usable = bool(np.isfinite(answer.rates_thrust).all())
        self._answer = answer if usable else None
        if usable and answer.status < MpcStatus.SHIFTED_PLAN:
            self._without_answer = 0
            self._is_owed = False

    def _begin_step(self, reading: Reading, x: np.ndarray, a: np.ndarray) -> None:
        in_force = self._sent
        teaches = self.phases.handed_over
        if not teaches and np.isfinite(reading.in_force).all():
            in_force = reading.in_force.copy()
            in_force[0] = thrust_of(self._vehicle, in_force[0], self.readings.voltage)
            # nothing is learned on the ground, nor by commands that are older than what is felt
            teaches = reading.as_felt and in_force[0] >= LEVEL_THRUST[0] * self._weight
        a = a if teaches else np.full(6, np.nan)
        lift = in_force[0] * attitude.body_z(x[Q])[2] - self._vehicle.mass * a[2]
        if self._is_trusted and np.isfinite(lift):
            share = self.config.controller.period / HEIGHT_KEPT
            self._lift += min(share, 1.0) * (lift - self._lift)
        self._worker.submit(
            partial(
                answer_of,
                self._companion,
                self._memory,
                self.flown_for,
                x=x if self._is_trusted else np.full(13, np.nan),
                acceleration=a,
                in_force=in_force,
            )
        )
        self.counts["periods"] += 1

    def _send(self, now: float, x: np.ndarray, a: np.ndarray) -> None:
        command = self._level(x) if self._answer is None else self._answer.rates_thrust.copy()
        most = np.array(self._loop.max_rate)
        command[0] = np.clip(command[0], 0.0, 4 * self._vehicle.max_rotor_thrust)
        command[1:] = np.clip(command[1:], -most, most)
        self._sent = command
        throttle = throttle_of(self._vehicle, command[0], self.readings.voltage)
        self.readings.sent.append(np.array([throttle, *command[1:]]))
        self._link.send(self._codec.command(now - self._begin, command[1:], throttle))
        if self._handed_over <= now and not self.leaves and self._is_trusted:
            u = np.array([command[0], *self._loop.torque(self._vehicle.J, x[W], command[1:])])
            row = (np.array(self.flown_for), x, a, u, command[1:])
            if all(np.isfinite(part).all() for part in row):
                self._rows.append(row)

    def _level(self, x: np.ndarray) -> np.ndarray:
        """Return level thrust (4,), that which held height last [N, rad/s]."""
        thrust = np.clip(self._lift, *(self._weight * LEVEL_THRUST))
        rates = rates_towards(x[Q], np.eye(3)[2], self._loop) if self._is_known else np.zeros(3)
        return np.array([thrust, *rates])

    def _say_hello(self, now: float) -> None:
        """Send the node's heartbeat, and ask for the messages that it needs."""
        if now < self._next_heartbeat - 1e-9:
            return
        self._next_heartbeat = now + (LEAVING if self.leaves else HEARTBEAT)
        out = self._codec.heartbeat()
        if self.leaves and self.phases.handed_over:
            out += self._codec.hold(self.readings.autopilot)
        elif not self.phase.sends:
            out += self._codec.request("HEARTBEAT", HEARTBEATS)
            out += b"".join(self._codec.request(name, self._limits.rate) for name in ASKED)
        self._link.send(out)


@contextlib.contextmanager
def ended_by_user() -> Iterator[Callable[[], bool]]:
    """Give whether the user has asked for the end, by SIGINT, SIGTERM or the end of the terminal.

    A second SIGINT ends at once.
    """
    asked: list[int] = []

    def take(number: int, frame: FrameType | None) -> None:
        if asked and number == signal.SIGINT:
            raise KeyboardInterrupt
        asked.append(number)

    before = {
        number: signal.signal(number, take)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    }
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def fly(
    node: Node,
    *,
    wait: float = float("inf"),
    ended: Callable[[], bool] = lambda: False,
    monitor: Callable[[Node, float], None] = lambda node, t: None,
) -> None:
    """Tick a node in real time until it has stopped; at the end of its motion the autopilot is
    asked to hold its place.

    On a simulated vehicle the time is the vehicle's (`NodeClock`).

    Args:
        wait: longest time until the autopilot hands over, by our clock [s].
        monitor: is shown the node every half a second of our clock, and the time on its reference
            [s].
    """
    period = 1 / node.config.offboard.rate
    begin = planned = time.monotonic()
    looked = -float("inf")
    while True:
        while (early := planned - (now := node.clock.read(time.monotonic(), node.listen()))) > 0:
            time.sleep(early)
        node.delays.append(now - planned)
        node.tick(now, PATIENCE * period)
        flown = node.flown_for
        waited = time.monotonic() - begin > wait and not node.phases.handed_over
        if not node.leaves and (flown >= node.config.end or ended() or waited):
            node.leave(now)
        if node.is_over(now):
            return
        if time.monotonic() - looked >= LOOKS:
            looked = time.monotonic()
            monitor(node, flown)
        planned += period
        if (behind := node.clock.read(time.monotonic(), []) - planned) > period:
            skipped = int(behind / period)
            node.counts["skipped"] += skipped
            planned += skipped * period


def flight_metrics(node: Node, flown: FlightLog) -> dict[str, Any]:
    """Return time and errors of a flight, without the ramp where it lasted longer."""
    scored = flown.t >= node.config.reference.lead
    scored = scored if scored.any() else ~scored
    errors = metrics.tracking_errors(flown.p[scored], node.config.motion.sample(flown.t[scored])[0])
    return {"flown": float(flown.t[-1]), **errors}


def deadlines(node: Node) -> dict[str, Any]:
    """Return counts and times of a node: ticks, late solves, jitter, ages, messages that were not
    taken.
    """
    times = {"solve_ms": node.solves, "jitter_ms": node.delays, "state_age_ms": node.readings.ages}
    return {
        **node.counts,
        **{name: metrics.solve_times_ms(np.array(t or [np.nan])) for name, t in times.items()},
        "refused": dict(node.readings.refused),
        "restarts": node.readings.restarts,
    }


def tables(node: Node) -> list[Table]:
    """Return the tables of a node: its flight, its phases, its deadlines."""
    phases = [(f"{t:.2f}", phase.value, reason) for t, phase, reason in node.events]
    counts = deadlines(node)
    refused = node.readings.refused
    times = [
        (name, *(f"{counts[key][part]:.2f}" for part in ("median", "p95", "max")))
        for name, key in (
            ("solve", "solve_ms"),
            ("tick after its time", "jitter_ms"),
            ("age of the state", "state_age_ms"),
        )
    ]
    counted = [
        ("ticks, of them skipped", f"{counts['ticks']}, {counts['skipped']}"),
        ("solves, of them late", f"{counts['periods']}, {counts['late']}"),
        ("messages out of turn, absurd", f"{refused['late']}, {refused['absurd']}"),
        ("restarts of the autopilot", str(counts["restarts"])),
        ("ticks that failed", str(counts["errors"])),
    ]
    shown: list[Table] = [
        ("phases", ["at [s]", "phase", "why"], phases),
        ("times [ms]", ["of", "median", "p95", "max"], times),
        ("counts", ["of", "number"], counted),
    ]
    if (flown := node.flown) is not None:
        scores = flight_metrics(node, flown)
        errors = (f"{100 * scores[key]:.2f}" for key in ("E_xy", "E_z"))
        row = (f"{scores['flown']:.1f}", *errors)
        shown.insert(0, ("flight", ["flown [s]", "E_xy [cm]", "E_z [cm]"], [row]))
    return shown


class LinkedFlight:
    """Simulated flight that takes its commands from a link: makes the controller of its vehicle,
    and measures the pace of the flight.

    mean: simulated time over real time, at the last measurement [1].
    """

    mean = 1.0

    def __init__(self, link: MavlinkLink):
        self.__name__ = "mavlink"  # of the controller, in the flight's files
        self._link = link

    def __call__(self, vehicle: Vehicle) -> OffboardAutopilot:
        """Return the controller of a vehicle."""
        self._system = OffboardAutopilot(vehicle, self._link)
        return self._system

    def factor(self, t: float) -> float:
        """Return simulated time over real time since the last call, at a time of the flight [s]; 1
        at its beginning.
        """
        now = np.array([t, time.monotonic()])
        if t == 0.0:
            self._begin = self._measured = now
            return self.mean
        flown, passed = now - self._measured
        all_flown, all_passed = now - self._begin
        self._measured = now
        self.mean = all_flown / all_passed
        return flown / passed

    def table(self) -> Table:
        """Return what the autopilot has seen of the flight."""
        seen = self._system.autopilot
        rows = [
            (name, ", ".join(f"{t:.1f}" for t in times) or "never")
            for name, times in (
                ("handed over at [s]", seen.handovers),
                ("took over at [s]", seen.failsafes),
            )
        ]
        rows.append(("simulated time over real time", f"{self.mean:.2f}"))
        return ("autopilot", ["what", "value"], rows)
