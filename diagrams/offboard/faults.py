"""Faults of link, state, solver and processes, while a node flies."""

import dataclasses as dc
from collections.abc import Callable

import numpy as np

from diagrams.offboard.companion import Answer
from diagrams.offboard.solver_thread import AtOnce
from diagrams.offboard.virtual_flight import WAY
from np_drake.offboard.autopilot import BOOT, SimulatedAutopilot
from np_drake.rigid_body import P, Q, V
from np_drake.vehicle import Vehicle

# By kind: what it does, and the range of its size; without a range it has none.
KINDS: dict[str, tuple[str, tuple[float, float] | None]] = {
    "loss": ("a share of the messages is lost [1]", (0.1, 0.9)),
    "silence": ("the link is dead", None),
    "delay": ("messages take longer [s]", (0.02, 0.3)),
    "disorder": ("each message takes its own time up to [s]", (0.02, 0.3)),
    "noise": ("bytes that are no messages come besides", None),
    "clock jump": ("the autopilot's clock jumps [s]", (-0.9, 100.0)),
    "frozen clock": ("stamps stand still", None),
    "autopilot restart": ("the autopilot restarts, and is silent meanwhile", None),
    "node restart": ("the node restarts, and is silent meanwhile", None),
    "pilot": ("the pilot takes over", None),
    "state not finite": ("one value of the state is NaN", None),
    "no attitude": ("the quaternion is zero", None),
    "position jump": ("the position jumps [m]", (0.4, 50.0)),
    "absurd speed": ("the velocity is absurd [m/s]", (20.0, 1e6)),
    "no inertial sensor": ("its readings are NaN", None),
    "late solves": ("solves take longer [s]", (0.01, 0.1)),
    "hanging solve": ("a solve does not end", None),
    "failing solve": ("the controller fails", None),
    "command not finite": ("the controller's command is NaN", None),
}
STATE_LOST = (
    "silence",
    "frozen clock",
    "autopilot restart",
    "state not finite",
    "no attitude",
    "no inertial sensor",
)
SOLVER = ("hanging solve", "failing solve", "command not finite")


@dc.dataclass(frozen=True)
class Fault:
    """One fault."""

    kind: str  # of `KINDS`
    begin: float  # [s]
    lasts: float  # [s]
    size: float = 0.0  # in the unit of the kind
    seed: int = 0  # of what it draws

    @classmethod
    def drawn(cls, kind: str, seed: int, begin: tuple[float, float]) -> "Fault":
        """Return a fault of a kind, between 0.05 and 3 s long.

        Args:
            kind: of `KINDS`.
            begin: earliest and latest beginning [s].
        """
        rng = np.random.default_rng([seed, *kind.encode()])
        span = KINDS[kind][1] or (0.0, 0.0)
        lasts = float(np.exp(rng.uniform(np.log(0.05), np.log(3.0))))
        return cls(
            kind,
            round(float(rng.uniform(*begin)), 2),
            round(lasts, 2),
            float(rng.uniform(*span)),
            seed,
        )

    def acts(self, t: float) -> bool:
        """Return whether it acts at a time [s]."""
        return self.begin <= t < self.begin + self.lasts

    def passes(self) -> Callable[[float], float]:
        """Return when a message that is sent at a time arrives, see `Channel`."""
        rng = np.random.default_rng(self.seed)

        def arrival(t: float) -> float:
            if not self.acts(t):
                return t + WAY
            if self.kind == "silence" or (self.kind == "loss" and rng.random() < self.size):
                return np.inf
            if self.kind == "disorder":
                return t + float(rng.uniform(WAY, self.size))
            return t + (self.size if self.kind == "delay" else WAY)

        return arrival

    def worker(self, clock: Callable[[], float]) -> AtOnce:
        """Return what steps the node's controller.

        Args:
            clock: time [s].
        """
        slow = {"late solves": self.size, "hanging solve": np.inf}.get(self.kind, 0.0)
        return _FaultyWorker(self, clock, lambda t: slow if self.acts(t) else 0.0)


class _FaultyWorker(AtOnce):
    def __init__(self, fault: Fault, clock: Callable[[], float], takes: Callable[[float], float]):
        super().__init__(takes)
        self._fault, self._clock = fault, clock

    def answer(self, now: float, patience: float) -> Answer | None:
        found = super().answer(now, patience)
        if found is None or not self._fault.acts(self._clock()):
            return found
        if self._fault.kind == "failing solve":
            raise RuntimeError("the controller fails.")
        if self._fault.kind == "command not finite":
            return dc.replace(found, rates_thrust=np.full(4, np.nan))
        return found


class FaultyAutopilot(SimulatedAutopilot):
    """Autopilot whose messages have a fault."""

    def __init__(self, vehicle: Vehicle, fault: Fault):
        super().__init__(vehicle)
        self._fault, self._rng = fault, np.random.default_rng(fault.seed)
        self._entry = int(self._rng.integers(13))
        way = self._rng.standard_normal(3)
        self._way = way / np.linalg.norm(way)
        self._began = False

    def take(self, data: bytes, t: float) -> None:
        """Take what has come; an autopilot that restarts hears nothing.

        Args:
            t: [s].
        """
        if not (self._fault.kind == "autopilot restart" and self._fault.acts(t)):
            super().take(data, t)

    def step(self, t: float, x: np.ndarray) -> np.ndarray:
        """Return what is in force; restart or pilot end what the companion commands."""
        fault, begins = self._fault, self._fault.acts(t) and not self._began
        self._began = self._began or begins
        if begins and fault.kind in ("autopilot restart", "pilot"):
            self.hold()
        if fault.kind == "pilot" and fault.acts(t):
            self._alive_since = t
        return super().step(t, x)

    def messages(self, t: float, x: np.ndarray, acceleration: np.ndarray) -> bytes:
        """Return what is due, with the fault."""
        fault, acts = self._fault, self._fault.acts(t)
        end = fault.begin + fault.lasts
        if fault.kind == "autopilot restart" and t >= fault.begin:
            if acts:
                return b""
            self.boot = -end
        elif fault.kind == "clock jump" and t >= fault.begin:
            self.boot = BOOT + fault.size
        elif fault.kind == "frozen clock":
            self.boot = BOOT + (fault.begin - t if acts else 0.0)
        out = super().messages(t, *(self._absurd(x, acceleration) if acts else (x, acceleration)))
        return (
            out + self._rng.bytes(int(self._rng.integers(1, 400)))
            if acts and fault.kind == "noise"
            else out
        )

    def _absurd(self, x: np.ndarray, acceleration: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        fault, x, acceleration = self._fault, x.copy(), acceleration.copy()
        if fault.kind == "state not finite":
            x[self._entry] = np.nan
        elif fault.kind == "no attitude":
            x[Q] = 0.0
        elif fault.kind == "position jump":
            x[P] += fault.size * self._way
        elif fault.kind == "absurd speed":
            x[V] = fault.size * self._way
        elif fault.kind == "no inertial sensor":
            acceleration[:] = np.nan
        return x, acceleration
