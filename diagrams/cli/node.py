"""`np-drake node`: fly a vehicle through its autopilot, by MAVLink."""

import dataclasses as dc
from queue import SimpleQueue
from threading import Thread
from typing import Annotated

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RollPitchYaw
from typer import Option

from diagrams.autopilot import node as nodes
from diagrams.batch.failed_run import FailedRun
from diagrams.cli import options
from diagrams.cli.fly import Experiment, Fields, Predictor, scenarios
from diagrams.cli.output import progress, say, tell
from diagrams.cli.runner import Report, Run, reports
from diagrams.loop.own_controller import is_own
from np_drake.autopilot.mavlink import MavlinkLink
from np_drake.logs.formats.log_file import write_log

# Share of the rate of a vehicle's clock that was told last, below which it is told again [1].
TOLD = 0.8
DEADLINE = 1.0  # of a solve, over the controller's period, where the scenario names none [1]


@reports("node", seed=None, out=options.Out, markdown=False)
def node(
    run: Run,
    experiment: Experiment,
    link: Annotated[
        str,
        Option(
            metavar="ADDRESS",
            help=(
                "udp:HOST:PORT listens, udpout:HOST:PORT calls; tcp:HOST:PORT; or a serial device."
            ),
        ),
    ] = "udp:127.0.0.1:14540",
    baud: Annotated[
        int, Option(min=1200, max=10_000_000, help="Of a serial device [1/s].")
    ] = 921600,
    controller: Annotated[
        str | None,
        Option(
            metavar="KIND",
            help="nominal | hold | observer | np | payload_filter | gp | knode. Default: np.",
        ),
    ] = None,
    predictor: Predictor = None,
    duration: Annotated[float | None, Option(help="Time after the ramp [s].")] = None,
    wait: Annotated[
        float | None,
        Option(min=1.0, max=86_400.0, help="Longest wait for the pilot; default: without end [s]."),
    ] = None,
    fields: Fields = None,
    vehicle: options.VehicleFile = None,
) -> Report:
    """Fly an experiment on a vehicle: state in and body rates out by MAVLink, while all is in
    order.
    """
    config = scenarios(
        experiment,
        [controller] if controller else [],
        vehicle=vehicle,
        predictor=predictor,
        autopilot="rate_loop",
        duration=duration,
        fields=fields or (),
    )[0]
    if is_own(config.controller.kind):
        raise ValueError(
            f"controller: must be one of this project's; got {config.controller.kind}. Name "
            f"another --controller, or simulate your own."
        )
    if config.controller.deadline == float("inf"):
        config.controller.deadline = DEADLINE * config.controller.period
    port, worker = MavlinkLink(link, baud), nodes.SolverThread()
    try:
        flying = nodes.Node(config, port, worker)
        say(
            f"{config.name} with {config.controller.name} at {config.offboard.rate:g} Hz "
            f"on {link}; Ctrl-C ends it."
        )
        with (
            nodes.ended_by_user() as ended,
            progress(f"flying {config.name}", config.end) as advance,
            _Told() as told,
        ):

            def monitor(now: nodes.Node, t: float) -> None:
                told.show(now)
                advance(t, f"{now.phase.value}{_pose(now.x)}")

            nodes.fly(
                flying, wait=float("inf") if wait is None else wait, ended=ended, monitor=monitor
            )
            told.show(flying)
    finally:
        worker.close()
        port.close()
    flown, failure = flying.flown, None
    if flown is None:
        failure = FailedRun(f"node: nothing was flown: {flying.lacks or flying.events[-1][2]}.")
    if flown is not None and run.out is not None:
        file = run.folder / f"{config.name}_{config.controller.name}.csv"
        write_log(flown, file)
        say(f"log: {file}")
    return Report(
        nodes.tables(flying),
        config={
            "experiment": config.name,
            "controller": config.controller.name,
            "offboard": dc.asdict(config.offboard),
        },
        metrics={
            "flight": None if flown is None else nodes.flight_metrics(flying, flown),
            "deadlines": nodes.deadlines(flying),
            "phases": [(t, phase.value, reason) for t, phase, reason in flying.events],
        },
        failure=failure,
    )


def _pose(x: np.ndarray) -> str:
    """Return attitude and height of a state (13,) in words; nothing where it is not known."""
    if not np.isfinite(x).all():
        return ""
    roll, pitch, yaw = np.degrees(
        RollPitchYaw(Quaternion(x[3:7] / np.linalg.norm(x[3:7]))).vector()
    )
    return (
        f": right down {roll:+.0f}, nose up {-pitch:+.0f}, left of east {yaw:+.0f} deg, "
        f"height {x[2]:.2f} m"
    )


class _Told:
    """Shows changes of phase, and what is waited for, from a thread of its own.

    A terminal that is not read must not stop a flight.
    """

    def __enter__(self) -> "_Told":
        self._lines: SimpleQueue[str | None] = SimpleQueue()
        self._shown, self._lacks, self._rate = 0, list[str](), 1.0
        self._thread = Thread(target=self._work, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._lines.put(None)
        self._thread.join(timeout=1.0)

    def show(self, node: nodes.Node) -> None:
        for t, phase, reason in node.events[self._shown :]:
            self._lines.put(f"{t:8.2f} s  {phase.value}: {reason}")
        self._shown = len(node.events)
        lacks = [w for w in node.lacks.split() if w.isalpha()]  # numbers change at every look
        if lacks and lacks != self._lacks:
            self._lines.put(f"{node.phase.value}: {node.lacks}")
        self._lacks = lacks
        if (node.lacks or node.clock.waits) and 0 < node.clock.rate < TOLD * self._rate:
            self._rate = node.clock.rate
            by = ", and the flight by it" if node.clock.waits else ""
            self._lines.put(f"the vehicle's clock runs at {self._rate:.2f} of real time{by}")

    def _work(self) -> None:
        while (line := self._lines.get()) is not None:
            tell(line)
