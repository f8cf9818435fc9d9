"""What a node records of its flight."""

import dataclasses as dc
from collections import deque
from typing import NamedTuple

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.offboard.phases import Phase
from np_drake.vehicle import Vehicle

KEPT = 100_000  # times that a report reads, the last [1]; source: own choice
PARTS = {"t": 1, "x": 13, "acceleration": 6, "u": 4, "rates": 3, "reference": 3}  # of a row


class Event(NamedTuple):
    """Change of phase."""

    time: float  # since the first tick [s]
    phase: Phase
    reason: str


@dc.dataclass
class Counts:
    """What a report tells of deadlines."""

    ticks: int = 0
    skipped: int = 0  # ticks that had no time
    periods: int = 0  # of the controller, while it commands
    late: int = 0  # of them without an answer until the next
    errors: int = 0  # ticks that failed
    solves: deque[float] = dc.field(default_factory=lambda: deque(maxlen=KEPT))  # times [s]
    delays: deque[float] = dc.field(
        default_factory=lambda: deque(maxlen=KEPT)
    )  # of ticks after their time [s]


@dc.dataclass(frozen=True)
class Flown:
    """Flight in the axes of its reference."""

    log: FlightLog
    reference: np.ndarray  # (n, 3) position where it should be [m]


class FlightRecord:
    """Rows of a flight; it begins empty."""

    def __init__(self) -> None:
        self._rows: list[np.ndarray] = []

    def add(self, **parts: np.ndarray) -> None:
        """Add a row of the parts of `PARTS`; one that is not finite is left out."""
        row = np.concatenate([np.atleast_1d(parts[name]) for name in PARTS])
        if np.isfinite(row).all():
            self._rows.append(row)

    def flown(self, vehicle: Vehicle, name: str) -> Flown | None:
        """Return the flight; None where there are no two rows."""
        if len(self._rows) < 2:
            return None
        ends = np.cumsum([*PARTS.values()])[:-1]
        t, x, acceleration, u, rates, reference = np.split(np.array(self._rows), ends, axis=1)
        log = FlightLog(
            t=t[:, 0],
            p=x[:, :3],
            q=x[:, 3:7],
            v=x[:, 7:10],
            w=x[:, 10:13],
            u=vehicle.saturate(u),
            a=acceleration[:, :3],
            al=acceleration[:, 3:],
            commanded_rates=rates,
            name=name,
        )
        return Flown(log, reference)
