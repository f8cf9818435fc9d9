"""Vehicle on a rail, which rests whatever is commanded, behind its autopilot; a node that is to fly
it.
"""

import dataclasses as dc

import numpy as np

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from diagrams.offboard.faults import Fault, FaultyAutopilot
from diagrams.offboard.node import Node
from diagrams.offboard.solver_thread import AtOnce
from np_drake.offboard.autopilot import SimulatedAutopilot
from np_drake.offboard.codec import AUTOPILOT, Codec, Command
from np_drake.offboard.link import Channel
from np_drake.vehicle.scaling import usual_rate_loop

TICK = 0.01  # [s]
PLACE = np.array([3.0, -2.0, 1.6])  # in the autopilot's local frame [m]


def hover(**changes: object) -> FlightConfig:
    """Return a hover for a node, with the controller `hold`."""
    config = load_experiment("hover")
    vehicle = dc.replace(config.vehicle, rate_loop=usual_rate_loop(config.vehicle))
    config = dc.replace(config, vehicle=vehicle).with_autopilot("rate_loop")
    config.controller.kind, config.controller.solver = "hold", "sqp"
    config.offboard.settle = 0.3
    return dc.replace(config, **changes).check()


class Rail:
    """Loop of vehicle and node, a tick of 10 ms after the other."""

    def __init__(self, config: FlightConfig, fault: Fault | None = None, *, pairs: bool = False):
        self.time, self.config, self.fault = 0.0, config, fault
        passes = fault.passes() if fault else lambda t: t + 0.001
        self.here, self.there = Channel.pair(lambda: self.time, passes)
        self.autopilot = (
            FaultyAutopilot(config.vehicle, fault)
            if fault
            else SimulatedAutopilot(config.vehicle, pairs=pairs)
        )
        self.x = np.array([*PLACE, 1.0, *np.zeros(9)])
        self.sent: list[tuple[float, Command]] = []
        self._codec, self._send = Codec(AUTOPILOT), self.here.send
        self.here.send = self._note
        self.node: Node | None = self.new_node()

    def new_node(self) -> Node:
        worker = self.fault.worker(lambda: self.time) if self.fault else AtOnce()
        return Node(self.config, self.here, worker)

    def advance(self, until: float) -> "Rail":
        while self.time < until - 1e-9:
            self.time = round(self.time + TICK, 9)
            for data in self.there.receive():
                self.autopilot.take(data, self.time)
            self.autopilot.step(self.time, self.x)
            if out := self.autopilot.messages(self.time, self.x, np.zeros(6)):
                self.there.send(out)
            if self.node is not None:
                self.node.tick(self.time)
        return self

    @property
    def phases(self) -> list[str]:
        return [] if self.node is None else [event.phase.value for event in self.node.events]

    def silent_from(self, begin: float, gap: float = 0.3) -> float | None:
        """Return the time of the last command before a gap, since `begin`; None where there is no
        gap [s].
        """
        times = np.array([t for t, _ in self.sent if t >= begin - gap] + [self.time])
        ends = np.flatnonzero(np.diff(times) > gap)
        return float(times[ends[0]] - begin) if len(ends) else None

    def _note(self, data: bytes) -> None:
        self.sent += [
            (self.time, said) for said in self._codec.parse(data) if isinstance(said, Command)
        ]
        self._send(data)
