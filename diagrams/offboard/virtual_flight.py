"""Vehicle and node in one process, in the time of the simulation: for tests, and for faults by the
hundred.
"""

import dataclasses as dc
from collections.abc import Callable

import numpy as np

from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_diagram import make_flight_diagram, make_simulator
from diagrams.loop.reality import REAL_VEHICLE
from diagrams.offboard.node import Node
from diagrams.offboard.solver_thread import AtOnce, Worker
from np_drake.offboard.autopilot import SimulatedAutopilot
from np_drake.offboard.codec import AUTOPILOT, Codec, Command
from np_drake.offboard.link import Channel, Link
from np_drake.references.config import ReferenceConfig
from np_drake.vehicle import Vehicle
from systems.offboard_autopilot import OffboardAutopilot

WAY = 0.001  # of a message [s]; source: own choice, a loopback's
AUTOPILOTS = Callable[[Vehicle], SimulatedAutopilot]


class _Tap(Link):
    """Link whose commands are noted.

    Args:
        clock: time [s].
    """

    def __init__(self, link: Link, clock: Callable[[], float]):
        self._link, self._clock, self._codec = link, clock, Codec(AUTOPILOT)
        self.sent: list[tuple[float, Command]] = []

    def send(self, data: bytes) -> None:
        for said in self._codec.parse(data):
            if isinstance(said, Command):
                self.sent.append((self._clock(), said))
        self._link.send(data)

    def receive(self) -> list[bytes]:
        return self._link.receive()

    def close(self) -> None:
        self._link.close()


class VirtualFlight:
    """A vehicle that hovers with its payload behind its autopilot, and a node that is to fly it.

    Args:
        passes: returns when what is sent at a time arrives, infinite for never [s].
    """

    def __init__(
        self,
        config: FlightConfig,
        *,
        seed: int = 0,
        passes: Callable[[float], float] = lambda t: t + WAY,
        autopilot: AUTOPILOTS = SimulatedAutopilot,
        worker: Callable[[], Worker] = AtOnce,
    ):
        self.config, self.time, self._worker = config, 0.0, worker
        here, there = Channel.pair(lambda: self.time, passes)
        self._link = _Tap(here, lambda: self.time)

        def make(vehicle: Vehicle) -> OffboardAutopilot:
            self.autopilot = autopilot(vehicle)
            return OffboardAutopilot(vehicle, there, self.autopilot)

        start = config.motion.sample(np.zeros(1))[0, 0]
        hover = dc.replace(config, reference=_hover(start), events=[])
        diagram = make_flight_diagram(hover, controller=make)
        self._simulator = make_simulator(diagram, hover, seed=seed)
        self._vehicle = diagram.GetSubsystemByName(REAL_VEHICLE)
        self.node: Node | None = self.new_node()  # None: its process is dead

    def advance(self, until: float) -> None:
        """Fly on until a time, by the node's ticks [s]."""
        period = 1 / self.config.offboard.rate
        while self.time < until - 1e-9:
            self.time = round(self.time + period, 9)
            self._simulator.AdvanceTo(self.time)
            if self.node is not None:
                self.node.tick(self.time)

    def new_node(self) -> Node:
        """Return a node that knows nothing, on the same link."""
        return Node(self.config, self._link, self._worker())

    @property
    def sent(self) -> list[tuple[float, Command]]:
        """Commands that nodes have sent so far, and when [s], whether they have arrived or not."""
        return self._link.sent

    @property
    def position(self) -> np.ndarray:
        """True position (3,) [m]."""
        context = self._simulator.get_context()
        return self._vehicle.GetOutputPort("x").Eval(self._vehicle.GetMyContextFromRoot(context))[
            :3
        ]


def _hover(start: np.ndarray) -> ReferenceConfig:
    return ReferenceConfig(track="hover", height=float(start[2]))
