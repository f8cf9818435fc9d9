"""Simulated flight whose controller is a process outside, by MAVLink."""

import time

import numpy as np
from pydrake.systems.framework import Context, Diagram

from diagrams.batch.run import Table
from diagrams.loop.flight_result import Watch
from np_drake.offboard.autopilot import SimulatedAutopilot
from np_drake.offboard.link import Link
from np_drake.vehicle import Vehicle
from systems.offboard_autopilot import OffboardAutopilot

PERIOD = 0.5  # between two looks [s]


class RealTime(Watch):
    """Viewer that shows nothing, sets the pace, and measures it.

    mean: simulated time over real time, at the last measurement [1].
    """

    period, rate, mean = PERIOD, 1.0, 1.0

    def begin(self, diagram: Diagram, context: Context) -> None:
        """Begin to measure."""
        self._begin = self._measured = np.array([context.get_time(), time.monotonic()])

    def look(self, context: Context) -> bool:
        """Let the flight go on."""
        return True

    def factor(self, t: float) -> float:
        """Return simulated time over real time since the last call, at a time of the flight [s]."""
        now = np.array([t, time.monotonic()])
        (flown, passed), (all_flown, all_passed) = now - self._measured, now - self._begin
        self._measured, self.mean = now, all_flown / all_passed
        return flown / passed


class CommandedByLink:
    """Maker of the controller of a flight that takes its commands from a link."""

    def __init__(self, link: Link):
        self.__name__ = "mavlink"  # of the controller, in the flight's files
        self._link = link
        self.autopilot: SimulatedAutopilot  # of the vehicle that was made last

    def __call__(self, vehicle: Vehicle) -> OffboardAutopilot:
        """Return the controller of a vehicle."""
        self.autopilot = SimulatedAutopilot(vehicle)
        return OffboardAutopilot(vehicle, self._link, self.autopilot)

    def table(self, factor: float) -> Table:
        """Return what the autopilot has seen of a flight with a real-time factor [1]."""
        autopilot = self.autopilot

        def times(values: list[float]) -> str:
            return ", ".join(f"{t:.1f}" for t in values) or "never"

        gap = f"{1e3 * autopilot.largest_gap:.0f}" if np.isfinite(autopilot.largest_gap) else "none"
        rows = [
            ("handed over at [s]", times(autopilot.handovers)),
            ("took over at [s]", times(autopilot.failsafes)),
            ("simulated time over real time", f"{factor:.2f}"),
            ("commands", str(autopilot.commands)),
            ("largest gap between them, while handed over [ms]", gap),
        ]
        return ("autopilot", ["what", "value"], rows)
