"""`np-drake node`: fly a vehicle through its autopilot, by MAVLink."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from diagrams.batch.failed_run import FailedRun
from diagrams.cli import options
from diagrams.cli.output import progress, say, tell
from diagrams.cli.runner import Report, Run, reports
from diagrams.cli.scenario import Numbers, scenarios

if TYPE_CHECKING:
    from diagrams.offboard.node import Node

DEADLINE = 1.0  # of a solve, over the controller's period, where the scenario names none [1]


@reports("node", seed=None, out=options.Out, markdown=False)
def node(
    run: Run,
    experiment: Annotated[str, Argument(help="circle, lemniscate, hover, … or a scenario file (YAML).")],
    link: Annotated[
        str,
        Option(
            metavar="ADDRESS", help="udp:HOST:PORT listens, udpout:HOST:PORT calls; tcp:HOST:PORT; or a serial device."
        ),
    ] = "udp:127.0.0.1:14540",
    baud: Annotated[int, Option(min=1200, max=10_000_000, help="Of a serial device [1/s].")] = 921600,
    rate: Annotated[
        float | None, Option(min=2.0, max=500.0, metavar="HZ", help="Of commands; default: the scenario's, or 100 Hz.")
    ] = None,
    controller: Annotated[
        str | None,
        Option(metavar="KIND", help="nominal | hold | observer | np | payload_filter | gp | knode. Default: np."),
    ] = None,
    solver: Annotated[
        str | None,
        Option(
            help="sqp | ipopt (MathematicalProgram, the reference); default: the scenario file's, or "
            f"{options.DEFAULT_SOLVER}."
        ),
    ] = None,
    predictor: Annotated[Path | None, Option(help="Model file of controller np, payload_filter, gp or knode.")] = None,
    duration: Annotated[float | None, Option(help="Time after the ramp [s].")] = None,
    wait: Annotated[
        float | None, Option(min=1.0, max=86_400.0, help="Longest wait for the pilot; default: without end [s].")
    ] = None,
    vehicle: options.VehicleFile = None,
) -> Report:
    """Fly an experiment on a vehicle: state in and body rates out by MAVLink, while all is in order."""
    import dataclasses as dc
    import time

    from diagrams.loop.own_controller import is_own
    from diagrams.offboard import real_time, report
    from diagrams.offboard.node import Node
    from diagrams.offboard.solver_thread import SolverThread
    from np_drake.offboard.link import MavlinkLink

    if controller is not None and is_own(controller):
        raise ValueError(f"--controller: must be one of this project's; got {controller}. Simulate your own.")
    config = scenarios(
        experiment, [controller] if controller else [], vehicle=vehicle, reality=None, solver=solver,
        predictor=predictor, told_mass=False, autopilot="rate_loop", numbers=Numbers(duration=duration),
    )[0]  # fmt: skip
    if rate is not None:
        config = dc.replace(config, offboard=dc.replace(config.offboard, rate=rate)).check()
    if config.controller.deadline == float("inf"):
        config.controller.deadline = DEADLINE * config.controller.period
    port, worker = MavlinkLink(link, baud), SolverThread()
    try:
        flown, told = Node(config, port, worker), 0
        say(f"{config.name} with {config.controller.name} at {config.offboard.rate:g} Hz on {link}; Ctrl-C ends it.")
        with real_time.Ended() as ended, progress(f"flying {config.name}", config.end) as advance:

            def monitor(now: "Node", t: float) -> None:
                nonlocal told
                for event in now.events[told:]:
                    say(f"{event.time:8.2f} s  {event.phase.value}: {event.reason}")
                told = len(now.events)
                advance(t, now.phase.value)

            real_time.fly(
                flown, wait=float("inf") if wait is None else wait, ended=lambda: ended.asked, monitor=monitor
            )
    finally:
        worker.close()
        port.close()
    flights, named = flown.flights, {"experiment": config.name, "controller": config.controller.name}

    def write(folder: Path) -> None:
        from np_drake.logs.formats.log_file import write_log

        for k, one in enumerate(flights):
            name = f"{config.name}_{config.controller.name}{f'_{k + 1}' if len(flights) > 1 else ''}.csv"
            write_log(one.log, folder / name)
            say(f"log: {folder / name}")

    if not flights:
        last = flown.events[-1].reason if flown.events else flown.readings.at(time.monotonic()).problem
        tell(f"nothing was flown: {last or 'the pilot has not handed over'}.")
    return Report(
        report.tables(flown),
        config={**named, "offboard": dc.asdict(config.offboard)},
        metrics={
            "flights": [report.flight_metrics(flown, one) for one in flights],
            "deadlines": report.deadlines(flown),
            "phases": [(event.time, event.phase.value, event.reason) for event in flown.events],
        },
        write=write,
        failure=None if flights else FailedRun("node: the pilot has not handed over, or the link is silent."),
    )
