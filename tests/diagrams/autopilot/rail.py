"""Links, workers, autopilots and vehicles of tests, in the time of a simulation, with faults."""

import dataclasses as dc

import numpy as np

from diagrams.autopilot import node as nodes
from diagrams.autopilot.node import LinkedFlight, Node
from diagrams.loop.experiments import load_experiment, with_payload
from diagrams.loop.flight import FlightConfig, flown_by
from diagrams.loop.flight_diagram import make_flight_diagram, make_simulator
from diagrams.loop.reality import REAL_VEHICLE
from np_drake.autopilot.mavlink import AUTOPILOT, Codec, Command
from np_drake.autopilot.simulated import BOOT, SimulatedAutopilot
from np_drake.mpc import controller
from np_drake.rigid_body import P, Q, V
from np_drake.vehicle.scaling import usual_rate_loop
from systems.offboard_autopilot import PERIOD
from tests.np_drake.autopilot.channel import Channel, local_position

TICK, WAY = 0.01, 0.001  # of a node, and of a message [s]
PLACE = np.array([3.0, -2.0, 1.6])  # in the autopilot's local frame [m]
STATE_LOST = ("silence", "frozen clock", "restart", "not finite", "no gyro", "no attitude")
SOLVER = ("hanging solve", "failing solve", "command not finite")
KINDS = {
    **dict.fromkeys((*STATE_LOST, *SOLVER, "noise", "node restart", "pilot"), 0.0),
    **{"loss": 0.7, "delay": 0.2, "disorder": 0.2},  # share [1], times [s]
    **{"clock jump": 50.0, "late solves": 0.03, "slow machine": 0.05},  # [s]
    **{"position jump": 9.0, "absurd speed": 1e3},  # [m], [m/s]
}


def flight(kind: str, experiment: str = "circle") -> FlightConfig:
    config = load_experiment(experiment)
    vehicle = dc.replace(config.vehicle, rate_loop=usual_rate_loop(config.vehicle))
    config = dc.replace(config, vehicle=vehicle).with_autopilot("rate_loop")
    config.controller.kind, config.controller.solver = kind, "sqp"
    return config.check_and_step()


def hover(**changes: object) -> FlightConfig:
    config = flight("hold", "hover")
    config.offboard.settle = 0.3
    return dc.replace(config, **changes).check()


@dc.dataclass(frozen=True)
class Fault:
    kind: str = ""
    begin: float = np.inf
    lasts: float = 0.0

    def acts(self, t: float) -> bool:
        return self.begin <= t < self.begin + self.lasts

    def passes(self):
        rng, size = np.random.default_rng(5), KINDS.get(self.kind, 0.0)

        def arrival(t: float) -> float:
            if not self.acts(t):
                return t + WAY
            lost = self.kind == "silence" or (self.kind == "loss" and rng.random() < size)
            late = {"delay": size, "disorder": float(rng.uniform(WAY, 0.2))}.get(self.kind, WAY)
            return np.inf if lost else t + late

        return arrival


class AtOnce:
    """Worker that steps at once, in the time of a simulation, and may have a fault."""

    def __init__(self, clock, fault: Fault):
        self._clock, self._fault, self._pending = clock, fault, None

    def submit(self, step) -> None:
        slow = {"hanging solve": np.inf, **{k: KINDS[k] for k in ("late solves", "slow machine")}}
        takes = slow.get(self._fault.kind, 0.0) if self._fault.acts(self._clock()) else 0.0
        self._pending = self._pending or (self._clock() + takes, step)

    def answer(self, patience: float):
        if self._pending is None or self._clock() + patience < self._pending[0]:
            return None
        (_, step), self._pending = self._pending, None
        found = step()
        if self._fault.kind == "failing solve" and self._fault.acts(self._clock()):
            return None
        if self._fault.kind == "command not finite" and self._fault.acts(self._clock()):
            return dc.replace(found, rates_thrust=np.full(4, np.nan))
        return found


class FaultyAutopilot(SimulatedAutopilot):
    def __init__(self, vehicle, fault: Fault):
        super().__init__(vehicle)
        self._fault, self._began = fault, False

    def take(self, data: bytes, t: float) -> None:
        if not (self._fault.kind == "restart" and self._fault.acts(t)):
            super().take(data, t)

    def step(self, t: float, x: np.ndarray) -> np.ndarray:
        if self._fault.acts(t) and self._fault.kind in ("restart", "pilot"):
            if not self._began:
                self.hold()
            self._began, self._alive_since = True, t
        return super().step(t, x)

    def messages(self, t: float, x: np.ndarray, acceleration: np.ndarray) -> bytes:
        fault, acts, x = self._fault, self._fault.acts(t), x.copy()
        size = KINDS.get(fault.kind, 0.0)
        if fault.kind == "restart" and acts:
            return b""
        if t >= fault.begin and fault.kind in ("restart", "clock jump"):
            restarted = -fault.begin - fault.lasts
            self.boot = BOOT + size if fault.kind == "clock jump" else restarted
        if fault.kind == "frozen clock":
            self.boot = BOOT + (fault.begin - t if acts else 0.0)
        if acts and fault.kind == "position jump":
            x[P] += size * np.array([0.6, 0.0, 0.8])
        if acts and fault.kind in ("not finite", "no attitude", "absurd speed"):
            part = {"not finite": V, "no attitude": Q, "absurd speed": V}[fault.kind]
            x[part] = {"not finite": np.nan, "no attitude": 0.0}.get(fault.kind, size)
        felt = acceleration * (np.nan if acts and fault.kind == "no gyro" else 1.0)
        noise = np.random.default_rng(round(1e4 * t)).bytes(99)
        return super().messages(t, x, felt) + (noise if acts and fault.kind == "noise" else b"")


class Rail:
    """Loop of a node and a vehicle on a rail, which rests whatever is commanded."""

    def __init__(self, config: FlightConfig, fault: Fault | None = None, *, pairs: bool = False):
        self.time, self.config, self.fault = 0.0, config, fault or Fault()
        self.here, self.there = Channel.pair(lambda: self.time, self.fault.passes())
        self.x = np.array([*PLACE, 1.0, *np.zeros(9)])
        self.sent: list[tuple[float, Command]] = []
        self._codec, self._send = Codec(AUTOPILOT), self.here.send
        self.here.send = self._note
        self.autopilot = FaultyAutopilot(config.vehicle, self.fault)
        if pairs:
            own = self.autopilot.codec
            own.odometry = lambda stamp, x: local_position(own, stamp, x)
        self.node = self.new_node()

    def new_node(self) -> Node:
        return Node(self.config, self.here, AtOnce(lambda: self.time, self.fault))

    def advance(self, until: float) -> "Rail":
        while self.time < until - 1e-9:
            self.time = round(self.time + TICK, 9)
            self._move()
            self.node.tick(self.time)
        return self

    def _move(self) -> None:
        for data in self.there.receive():
            self.autopilot.take(data, self.time)
        self.autopilot.step(self.time, self.x)
        if out := self.autopilot.messages(self.time, self.x, np.zeros(6)):
            self.there.send(out)

    @property
    def phases(self) -> list[str]:
        return [phase.value for _, phase, _ in self.node.events]

    def silent_from(self, begin: float, gap: float = 0.3) -> float | None:
        times = np.array([t for t, _ in self.sent if t >= begin - gap] + [self.time])
        ends = np.flatnonzero(np.diff(times) > gap)
        return float(times[ends[0]] - begin) if len(ends) else None

    def _note(self, data: bytes) -> None:
        said = [one for one in self._codec.parse(data) if isinstance(one, Command)]
        self.sent += [(self.time, one) for one in said]
        self._send(data)


class Busy:
    """Machine that runs a vehicle, a node and its solver only some of the time; all that is drawn
    is drawn by a seed.

    Args:
        payload: under the vehicle [kg].
        rate: real-time factor of the vehicle [1].
        beat: when the autopilot's first heartbeat comes, which tells when the others do [s].
        solve: mean time of a solve on an idle machine [s].
    """

    def __init__(self, kind: str, payload: float, rate: float, beat: float, solve: float, seed=0):
        self._rng, self._idle, self._solve = np.random.default_rng(seed), 1 / rate - 1, solve
        self.time, self.flown = 0.0, 0.0  # of the machine, of the vehicle [s]
        self._runs, self._turn, self._pending, self._spent = False, 0.0, None, 0.0
        here, there = Channel.pair(lambda: self.time, lambda now: now + 2e-4)
        pilot = LinkedFlight(there)
        hovering = flown_by(with_payload(flight("hold", "hover"), payload), pilot)
        self._diagram = make_flight_diagram(hovering, controller=pilot)
        self._vehicle = self._diagram.GetSubsystemByName(REAL_VEHICLE)
        self._simulator = make_simulator(self._diagram, hovering, seed=seed)
        self.autopilot = self._diagram.GetSubsystemByName("own_controller").autopilot
        self.autopilot._next_heartbeat = beat
        self.heights: list[float] = []  # while the node's commands are in force [m]
        config = flight(kind)
        config.controller.deadline = config.controller.period
        self.node = Node(config, here, self)

    def fly(self, seconds: float, monkeypatch) -> "Busy":
        """Run the node until its motion has lasted for a time, 20 s at most."""
        monkeypatch.setattr(nodes, "time", self)
        monkeypatch.setattr(controller, "time", self)
        over = self.node.is_over
        self.node.is_over = lambda now: over(now) or self.node.flown_for >= seconds
        nodes.fly(self.node, wait=20.0)
        return self

    def monotonic(self) -> float:
        return self.time

    def perf_counter(self) -> float:
        self._spent += self._took / 2  # it is read before and after a solve
        return self._spent

    def sleep(self, seconds: float) -> None:
        end = self.time + seconds + self._rng.exponential(0.002 * self._idle + 1e-4)
        while self.time < end:
            if self.time >= self._turn:
                self._runs = not self._runs
                turn = 0.012 * (1.0 if self._runs else self._idle)
                self._turn = self.time + self._rng.exponential(turn)
            step = min(end, self._turn, self.time + 0.0025) - self.time + 1e-9
            self.time += step
            if self._runs:
                self._advance(step)

    def _advance(self, step: float) -> None:
        self.flown += step
        context, due = self._simulator.get_context(), PERIOD * int(self.flown / PERIOD)
        if due > context.get_time():
            self._simulator.AdvanceTo(due)
            if self.autopilot.engaged:
                x = self._vehicle.GetOutputPort("x")
                self.heights.append(x.Eval(self._vehicle.GetMyContextFromRoot(context))[2])

    def submit(self, step) -> None:
        takes = self._solve * (0.5 + self._rng.exponential(0.5)) * (1 + self._idle)
        self._pending = self._pending or (self.time + takes, takes, step)

    def answer(self, patience: float):
        if self._pending is None:
            return None
        self.sleep(np.clip(self._pending[0] - self.time, 0.0, patience))
        if self.time < self._pending[0]:
            return None
        (_, self._took, step), self._pending = self._pending, None
        return step()
