"""`np-drake fly`: simulate one experiment with one controller, or with several to compare them.
`np-drake node`: fly a vehicle through its autopilot, by MAVLink.
"""

import copy
import dataclasses as dc
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Annotated, Any

import numpy as np
import yaml
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RollPitchYaw
from typer import Argument, Option

from diagrams.autopilot import node as nodes
from diagrams.autopilot.node import LinkedFlight
from diagrams.batch.run import FailedRun, part_of, require
from diagrams.cli.verb import (
    OUT,
    Report,
    Run,
    Table,
    VehicleFile,
    option,
    progress,
    reports,
    say,
    tell,
)
from diagrams.evidence.studies.options import DEFAULT_SOLVER, Reality
from diagrams.loop import comparison
from diagrams.loop.controller_config import LEARNED
from diagrams.loop.controllers import kind_of_model, make_residual_model
from diagrams.loop.experiments import (
    EXPERIMENTS,
    load_experiment,
    scenario_file,
    settings_of,
    with_field,
    with_payload,
)
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_diagram import make_flight_diagram
from diagrams.loop.flight_result import FlightResult
from diagrams.loop.flight_result import fly as simulate
from diagrams.loop.mcap_flight import require_mcap, write_flight_mcap
from diagrams.loop.own_controller import is_own
from diagrams.loop.replay import write_replay
from np_drake.autopilot.betaflight import find_firmware
from np_drake.autopilot.mavlink import MavlinkLink
from np_drake.command_delay import LONGEST_DELAY
from np_drake.files.figure_file import save
from np_drake.files.yaml_file import read_yaml
from np_drake.logs.formats.log_file import write_log
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.vehicle import load_vehicle
from np_drake.vehicle.scaling import usual_rate_loop

Experiment = Annotated[
    str, Argument(help="circle, lemniscate, hover, … or a scenario file (YAML).")
]
Predictor = Annotated[
    Path | None, Option(help="Model file of controller np, payload_filter, gp or knode.")
]
Fields = Annotated[
    list[str] | None,
    Option(
        "--set",
        metavar="FIELD=VALUE",
        help="Change a field of the scenario file, as reference.speed=2, "
        "reality.wind=[2,0,0] or controller.solver=ipopt; repeatable.",
    ),
]


@dc.dataclass(frozen=True)
class FlyOptions:
    """Options of `fly`: the scenario that is asked for, and files of the flight."""

    experiment: Experiment
    controller: list[str] = option(
        "nominal | hold | observer | oracle | cascade | np | payload_filter | gp | knode, or "
        "MODULE:NAME of your own; several times: fly each and compare them. Default: the "
        "scenario's, or payload_filter.",
        default=(),
        metavar="KIND",
    )
    predictor: Predictor = None
    duration: float | None = option("Scored time after the ramp [s].")
    payload: float | None = option("Mass of the payload; 0: none [kg].", metavar="KG")
    fields: Fields = None
    autopilot: str | None = option(
        "none | rate_loop (the vehicle file's) | betaflight (its firmware; extra autopilot).",
        metavar="KIND",
    )
    link: str | None = option(
        "Fly in real time what `np-drake node` commands by MAVLink; udpout:HOST:PORT.",
        metavar="ADDRESS",
    )
    vehicle: VehicleFile = None
    reality: Reality = None
    mcap: Path | None = option(
        "Write the flight as MCAP for Foxglove and PlotJuggler (extra mcap).", metavar="FILE"
    )


@reports("fly", seed=0, out=OUT, markdown=False, files=("mcap",))
def fly(run: Run, asked: FlyOptions) -> Report:
    """Simulate an experiment; with --out: flight log, figures and a 3-D replay page."""
    link = asked.link
    mcap = asked.mcap
    require(
        link is None or not (asked.controller or asked.predictor),
        "give either --link, whose node has the controller, or --controller and --predictor.",
    )
    if link is not None:
        autopilot = asked.autopilot or "rate_loop"
        asked = dc.replace(asked, controller=["hold"], autopilot=autopilot)
    configs = scenarios(asked)
    require(
        mcap is None or len(configs) == 1,
        "give either --mcap, which takes one flight, or several --controller.",
    )
    if mcap is not None:
        require_mcap(mcap)
        require(
            mcap.suffix == ".mcap", f"--mcap: must be a file whose name ends in .mcap; got {mcap}."
        )
    compared = len(configs) > 1
    lost = list[FailedRun]()
    if link is not None:
        flight, linked = _fly_linked(configs[0], run.seed, link)
        flights = [flight]
        tables = [linked]
        figures = list[str]()
        metrics = {"experiment": configs[0].name, "autopilot": dict(linked[2])}
    else:
        flights = fly_all(configs, run.seed, lost)
        tables = [flights_table(flights)]
        figures = ["track", "errors", "wrench"]
        summaries = [flight.summary() for flight in flights]
        metrics = {"flights": summaries} if compared else summaries[0]
    if mcap is not None:
        write_flight_mcap(flights[0], mcap)
        say(f"MCAP: {mcap}")

    def write(folder: Path) -> None:
        for flight in flights:
            _write_flight(flight, folder, ["wrench"] if compared else figures)
        if compared:
            named = [str(one) for one in lost]
            say(f"comparison: {comparison.write_comparison(flights, folder, lost=named)}")

    summary = [comparison.sentence(flights), *filter(None, [comparison.models(flights)])]
    settings = {config.controller.name: settings_of(config) for config in configs}
    return Report(
        tables,
        config=settings if compared else settings_of(configs[0]),
        metrics=metrics,
        summary=summary if compared else [],
        notes=[] if link is not None else [note for flight in flights for note in _notes(flight)],
        warnings=[text for flight in flights for text in flight.warnings()],
        write=write,
        failure=FailedRun(" ".join(map(str, lost))) if lost else None,
    )


def scenarios(asked: FlyOptions) -> list[FlightConfig]:
    """Return a checked scenario for every controller; what cannot be flown is refused before any
    work.

    Raises: ValueError: on bad input.
    """
    experiment = asked.experiment
    predictor = asked.predictor
    payload = asked.payload
    fields = [*(asked.fields or ())]
    require(
        asked.reality is None or asked.vehicle is None,
        "give either --reality, which has a vehicle of its own, or --vehicle.",
    )
    changed = bool(fields) or payload is not None or asked.reality is not None
    differs = changed or asked.controller or predictor or asked.duration or asked.autopilot
    first = load_experiment(
        experiment,
        None if asked.vehicle is None else load_vehicle(asked.vehicle),
        asked.reality,
        checked=not differs,
    )
    content = read_yaml(scenario_file(experiment))
    if "solver" not in (content.get("controller") or {}):
        first.controller.solver = DEFAULT_SOLVER
    in_file = asked.reality is None and "simulator" in content
    named = in_file or any(field.startswith("simulator.") for field in fields)
    if payload is not None:
        first = with_payload(first, payload)
    wanted = [*fields, *([f"duration={asked.duration}"] if asked.duration else [])]

    def checked(config: FlightConfig) -> FlightConfig:
        config = config.check_and_step() if changed and not named else config.check()
        return config if asked.autopilot is None else _with_autopilot(config, asked.autopilot)

    chosen = asked.controller or any(field.startswith("controller.kind=") for field in fields)
    default = experiment in EXPERIMENTS and not chosen
    kinds = asked.controller or [first.controller.kind]
    if default and predictor is not None:
        kinds = [kind_of_model(str(predictor))]
    configs = [_with_fields(_with_controller(first, kind), wanted) for kind in kinds]
    if predictor is not None:
        _give(predictor, configs)
    configs = [checked(config) for config in configs]
    if default and predictor is None:
        configs = [_with_controller(configs[0], _default_controller(configs[0]))]
    _require_flyable(configs)
    return configs


def scenario(asked: Any, **more: Any) -> FlightConfig:
    """Return the checked scenario of a verb whose options are called as those of `fly`, with one
    controller.

    Args:
        more: options of `fly` that are not all verbs'.
    Raises: ValueError: on bad input.
    """
    options = FlyOptions(
        asked.experiment,
        [asked.controller] if asked.controller else [],
        predictor=asked.predictor,
        duration=asked.duration,
        fields=asked.fields,
        vehicle=asked.vehicle,
        **more,
    )
    return scenarios(options)[0]


def _require_flyable(configs: Sequence[FlightConfig]) -> None:
    """Check that firmware, model and controller of each scenario are there, and their names differ.

    Raises: ValueError: where one is not.
    """
    for config in configs:
        config.check()
        if config.autopilot.kind == "betaflight":
            find_firmware()
        make_residual_model(config.controller, config.controller.believed(config.vehicle))
        if is_own(config.controller.kind):
            make_flight_diagram(config)
    names = [config.controller.name for config in configs]
    if twice := [name for name in names if names.count(name) > 1]:
        raise ValueError(
            f"--controller: two are called {twice[0]}, and so would their files be. Rename one."
        )


def _with_controller(config: FlightConfig, kind: str) -> FlightConfig:
    """Return a copy with a controller of a kind, without what is of another one."""
    config = copy.deepcopy(config)
    if kind != config.controller.kind:
        config.controller.parameters = {}
        config.controller.predictor = ""
    config.controller.kind = kind
    return config


def _with_fields(config: FlightConfig, fields: Sequence[str]) -> FlightConfig:
    """Return the scenario with the fields of `--set`.

    Raises: ValueError: on an unknown field, or a value of another kind.
    """
    for text in fields:
        name, sign, value = text.partition("=")
        require(bool(sign), f"--set: must be FIELD=VALUE, as reference.speed=2; got {text!r}.")
        try:
            config = with_field(config, name, yaml.safe_load(value))
        except (ValueError, yaml.YAMLError) as error:
            raise ValueError(f"--set {text}: {error}") from error
    return config


def _with_autopilot(config: FlightConfig, kind: str) -> FlightConfig:
    """Return the scenario with an autopilot, by the loop of a usual tune where the vehicle's file
    names none.
    """
    config = config.with_autopilot(kind)
    config.autopilot.check()
    if config.autopilot.flies and config.vehicle.rate_loop is None:
        loop = usual_rate_loop(config.vehicle)
        lags = ", ".join(f"{1e3 * lag:.0f}" for lag in loop.lag)
        tell(
            f"vehicle {config.vehicle.name!r} names no rate_loop; lags of {lags} ms are "
            f"taken. identify LOG tells them."
        )
        config = dc.replace(config, vehicle=dc.replace(config.vehicle, rate_loop=loop))
    return config


def _give(predictor: Path, configs: Sequence[FlightConfig]) -> None:
    """Give a model file to the controller that it is for, or to the first, which refuses it; others
    fly the packaged model.

    Raises: ValueError: where none of them flies a model.
    """
    controllers = [config.controller for config in configs if config.controller.kind in LEARNED]
    require(bool(controllers), f"--predictor: is for {', '.join(LEARNED)}; none of them flies.")
    kind = kind_of_model(str(predictor))
    fits = [one for one in controllers if one.kind == kind] or controllers
    fits[0].predictor = str(predictor)


def _default_controller(config: FlightConfig) -> str:
    """Return `payload_filter`, or `hold`, which needs no model, and say so.

    The packaged model knows the paper's vehicle.
    """
    try:
        make_residual_model(dc.replace(config.controller, kind=PAYLOAD_FILTER), config.vehicle)
    except ValueError:
        tell(
            f"controller: hold, as the packaged predictor is for the paper's vehicle and not for "
            f"{config.vehicle.name}; np-drake train LOG makes one of its own."
        )
        return "hold"
    return PAYLOAD_FILTER


def fly_all(configs: list[FlightConfig], seed: int, lost: list[FailedRun]) -> list[FlightResult]:
    """Simulate scenarios that begin and end alike, one after the other, behind one progress bar.

    Args:
        lost: takes what ended a flight early.
    Raises: FailedRun: where no flight is left; it names all.
    """
    flights = []
    first = configs[0]
    names = ", ".join(dict.fromkeys(config.controller.name for config in configs))
    with progress(f"flying {first.name} with {names}", len(configs) * first.end) as advance:
        for k, config in enumerate(configs):
            try:
                flights.append(simulate(config, seed=seed, monitor=part_of(advance, k * first.end)))
            except FailedRun as failed:
                lost.append(failed)
    if not flights:
        raise FailedRun(" ".join(map(str, lost)))
    return flights


def _fly_linked(config: FlightConfig, seed: int, address: str) -> tuple[FlightResult, Table]:
    """Simulate in real time a vehicle that a process outside commands by MAVLink, until its end.

    Raises: ValueError: where the link cannot be opened.
    """
    with closing(MavlinkLink(address)) as link:
        linked = LinkedFlight(link)
        say(f"{config.name} behind {address}: np-drake node flies it.")
        with progress(f"flying {config.name}", config.end) as advance:
            flight = simulate(
                config,
                seed=seed,
                monitor=lambda t: advance(t, f"at {linked.factor(t):.2f} of real time"),
                real_time=True,
                controller=linked,
            )
    return flight, linked.table()


def _notes(flight: FlightResult) -> list[str]:
    """Return a line about the delay of commands with which the controller reckoned at the end."""
    longest = LONGEST_DELAY * flight.config.controller.period
    more = " or later, the latest that is looked for" if flight.delay > longest - 1e-9 else ""
    late = f"the controller takes commands to act {1e3 * flight.delay:.3g} ms late{more}"
    return [late] if flight.delay else []


def flights_table(flights: Sequence[FlightResult]) -> Table:
    """Return a table with a line for every flight: errors in cm, solve times in ms."""
    rows: list[tuple] = []
    for flight in flights:
        scores = flight.metrics()
        errors = (round(100 * scores[kind], 2) for kind in ("E_xy", "E_z"))
        times = (scores["solve_ms"][part] for part in ("median", "p95"))
        rows.append((flight.config.name, flight.label, *errors, *times, scores["solve_failures"]))
    header = [
        "experiment",
        "controller",
        "E_xy [cm]",
        "E_z [cm]",
        "solve [ms]",
        "p95 [ms]",
        "failed",
    ]
    return f"seed {flights[0].seed}, {flights[0].config.controller.solver}", header, rows


def _write_flight(flight: FlightResult, folder: Path, figures: Sequence[str]) -> None:
    """Write flight log, figures and replay page of a flight, named by its controller."""
    stem = comparison.stem(flight)
    write_log(flight.log(), folder / f"{stem}.csv")
    if flight.blackbox:
        (folder / f"{stem}.bbl").write_bytes(flight.blackbox)
    for what in figures:
        save(flight.plot(what), folder / f"{stem}_{what}.png")
    write_replay(flight, folder / f"{stem}_replay.html")
    say(f"log, figures, replay: {folder}/{stem}*")


SLOWER = 0.8  # share of the clock's rate that was shown last, below which it is shown again [1]
DEADLINE = 1.0  # by which a solver wraps up, over the controller's period, where none is named [1]


@dc.dataclass(frozen=True)
class NodeOptions:
    """Options of `node`."""

    experiment: Experiment
    link: str = option(
        "udp:HOST:PORT listens, udpout:HOST:PORT calls; tcp:HOST:PORT; or a serial device.",
        default="udp:127.0.0.1:14540",
        metavar="ADDRESS",
    )
    baud: int = option("Of a serial device [1/s].", default=921600, min=1200, max=10_000_000)
    controller: str | None = option(
        "nominal | hold | observer | np | payload_filter | gp | knode. Default: payload_filter.",
        metavar="KIND",
    )
    predictor: Predictor = None
    duration: float | None = option("Time after the ramp [s].")
    wait: float | None = option(
        "Longest wait for the pilot; default: without end [s].", min=1.0, max=86_400.0
    )
    fields: Fields = None
    vehicle: VehicleFile = None


@reports("node", seed=None, out=OUT, markdown=False)
def node(run: Run, asked: NodeOptions) -> Report:
    """Fly an experiment on a vehicle: state in and body rates out by MAVLink, while all is in
    order.
    """
    config = scenario(asked, autopilot="rate_loop")
    require(
        not is_own(config.controller.kind),
        f"controller: must be one of this project's; got {config.controller.kind}. Name "
        f"another --controller, or simulate your own.",
    )
    if config.controller.deadline == np.inf:
        config.controller.deadline = DEADLINE * config.controller.period
    connection = MavlinkLink(asked.link, asked.baud)
    with closing(connection) as port, closing(nodes.SolverThread()) as worker:
        flying = nodes.Node(config, port, worker)
        say(
            f"{config.name} with {config.controller.name} at {config.offboard.rate:g} Hz "
            f"on {asked.link}; Ctrl-C ends it."
        )
        with (
            nodes.ended_by_user() as ended,
            progress(f"flying {config.name}", config.end) as advance,
            _Messages() as messages,
        ):

            def monitor(now: nodes.Node, t: float) -> None:
                messages.show(now)
                advance(t, f"{now.phase.value}{_pose(now.x)}")

            wait = np.inf if asked.wait is None else asked.wait
            nodes.fly(flying, wait=wait, ended=ended, monitor=monitor)
            messages.show(flying)
    flown = flying.flown
    why = flying.lacks or flying.events[-1][2]
    if flown is not None and run.out is not None:
        file = run.folder / f"{config.name}_{config.controller.name}.csv"
        write_log(flown, file)
        say(f"log: {file}")
    return Report(
        nodes.tables(flying) if flying.events else [],
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
        failure=FailedRun(f"node: nothing was flown: {why}.") if flown is None else None,
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


class _Messages:
    """Shows changes of phase, and what is waited for, from a thread of its own.

    A terminal that is not read must not stop a flight.
    """

    def __enter__(self) -> "_Messages":
        self._lines: SimpleQueue[str | None] = SimpleQueue()
        self._shown = 0
        self._lacks = list[str]()
        self._rate = 1.0
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
        if (node.lacks or node.clock.waits) and 0 < node.clock.rate < SLOWER * self._rate:
            self._rate = node.clock.rate
            by = ", and the flight by it" if node.clock.waits else ""
            self._lines.put(f"the vehicle's clock runs at {self._rate:.2f} of real time{by}")

    def _work(self) -> None:
        while (line := self._lines.get()) is not None:
            tell(line)
