"""Node in real time on a vehicle that another process simulates, beside the same flight in one
Diagram.
"""

import dataclasses as dc
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import fly
from diagrams.offboard import real_time, report
from diagrams.offboard.node import Node
from diagrams.offboard.solver_thread import SolverThread
from np_drake import metrics
from np_drake.offboard.link import MavlinkLink

BEFORE, AFTER = (
    60.0,
    20.0,
)  # time that a vehicle may take to be flown, and that it flies after the node [s]
VEHICLE = "hover"  # experiment of the vehicle until its node commands it


def flown_beside(
    config: FlightConfig, *, seed: int, monitor: Callable[[float], None]
) -> dict[str, Any]:
    """Return deadlines and errors of a node in real time, with those of the Diagram's own flight.

    Args:
        config: of the flight, whose vehicle and reality are those of the experiment `VEHICLE`.
        monitor: is called with the time flown [s].
    Raises: ValueError: where the vehicle does not come up.
    """
    address = f"127.0.0.1:{_free_port()}"
    command = [
        sys.executable,
        "-m",
        "np_drake",
        "fly",
        VEHICLE,
        "--link",
        f"udpout:{address}",
        "--seed",
        str(seed),
        "--duration",
        f"{config.end + BEFORE + AFTER:g}",
    ]
    link, worker = MavlinkLink(f"udp:{address}"), SolverThread()
    with tempfile.TemporaryFile("w+") as said:
        vehicle = subprocess.Popen(
            command, stdout=said, stderr=subprocess.STDOUT, cwd=Path(__file__).parents[2]
        )
        try:
            node = Node(config, link, worker)
            real_time.fly(
                node,
                wait=BEFORE,
                monitor=lambda _, t: monitor(t),
                ended=lambda: vehicle.poll() is not None,
            )
        finally:
            vehicle.kill()
            vehicle.wait()
            worker.close()
            link.close()
        flight = node.flown
        if flight is None:
            said.seek(0)
            raise ValueError(f"node: the vehicle was not handed over: {said.read().strip()[-200:]}")
    flown = report.flight_metrics(node, flight)
    own = fly(dc.replace(config), seed=seed)
    rows, signals = own.scored, own.signals
    diagram = metrics.tracking_errors(signals["x"][rows, :3], signals["p_ref"][rows])
    ratio = flown["E_xy"] / diagram["E_xy"]
    return {
        "node": flown,
        "diagram": diagram,
        "ratio": ratio,
        "deadlines": report.deadlines(node),
        "rate": float(1 / np.mean(np.diff(flight.log.t))),
    }


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
