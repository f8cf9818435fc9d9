"""`np-drake fly`: simulate one experiment with one controller."""

import dataclasses as dc
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from diagrams.batch.columns import Column, tabulate
from diagrams.cli import options
from diagrams.cli.output import Table, progress, say
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from diagrams.loop.flight import FlightConfig
    from diagrams.loop.flight_result import FlightResult


@reports("fly", seed=0, out=options.Out, markdown=False, holds=("mcap",))
def fly(
    run: Run,
    experiment: Annotated[str, Argument(help="circle, lemniscate, hover, … or a scenario file (YAML).")],
    controller: Annotated[
        str | None,
        Option(
            help="nominal | hold | observer | oracle | cascade | np | payload_filter | gp | knode; "
            "default: the scenario's, or np."
        ),
    ] = None,
    solver: Annotated[
        str | None,
        Option(
            help="sqp | ipopt (MathematicalProgram, the reference) | ipopt_multiple_shooting (the test oracle: "
            f"0.2 to 1 s a solve); default: the scenario file's, or {options.DEFAULT_SOLVER}."
        ),
    ] = None,
    predictor: Annotated[Path | None, Option(help="Model file of controller np, payload_filter, gp or knode.")] = None,
    told_mass: Annotated[
        bool, Option("--told-mass", help="Known mass: controller and estimator have the payload's.")
    ] = False,
    duration: Annotated[float | None, Option(help="Scored time after the ramp [s].")] = None,
    vehicle: options.VehicleFile = None,
    reality: options.Reality = None,
    sample: Annotated[
        int | None,
        Option(min=1, max=10_000, metavar="N", help="Fly N simulators drawn from the posterior of a corrected one."),
    ] = None,
    mcap: Annotated[
        Path | None, Option(metavar="FILE", help="Write the flight as MCAP for Foxglove and PlotJuggler (extra mcap).")
    ] = None,
    live: Annotated[
        bool, Option("--live", help="Fly in real time in a browser (Meshcat), and be pushed there.")
    ] = False,
) -> Report:
    """Simulate an experiment; with --out: flight log, figures and a 3-D replay page."""
    from diagrams.gap.corrected import drawn
    from diagrams.loop.controllers import make_residual_model
    from diagrams.loop.experiments import EXPERIMENTS, load_experiment
    from diagrams.loop.flight_diagram import make_flight_diagram
    from diagrams.loop.own_controller import is_own
    from np_drake.vehicle import load_vehicle

    if reality is not None and vehicle is not None:
        raise ValueError("give either --reality, which has a vehicle of its own, or --vehicle.")
    config = load_experiment(experiment, None if vehicle is None else load_vehicle(vehicle), reality)
    if controller is not None:
        config.controller.kind, config.controller.parameters = controller, {}
    elif experiment in EXPERIMENTS:
        config.controller.kind = _default_controller(config, predictor)
    config.controller.solver = solver or named_solver(experiment) or options.DEFAULT_SOLVER
    if predictor is not None:
        config.controller.predictor = str(predictor)
    if told_mass:
        config.controller.extra_mass = config.reality.hung.mass
    if duration is not None:
        config.duration = duration
    config.check()
    believed = config.controller.believed(config.vehicle)
    make_residual_model(config.controller, believed)  # refused before any work
    if is_own(config.controller.kind):
        make_flight_diagram(config)
    if sample is not None and (live or mcap is not None):
        one = "--live, which shows" if live else "--mcap, which holds"
        raise ValueError(f"give either {one} one flight, or --sample.")
    if mcap is not None:
        _require_mcap_output(mcap)
    configs = [config] if sample is None else drawn(config, sample, run.seed)
    flights = [_fly_live(config, run.seed)] if live else _fly_all(configs, run.seed)
    if mcap is not None:
        from diagrams.loop.mcap_flight import write_flight_mcap

        write_flight_mcap(flights[0], mcap)
        say(f"MCAP: {mcap}")

    def write(folder: Path) -> None:
        for flight in flights:
            _write_flight(flight, folder)

    summaries = [flight.summary() for flight in flights]
    return Report(
        [flights_table(flights)],
        config=as_config(config),
        metrics=summaries[0] if sample is None else {"flights": summaries},
        notes=[note for flight in flights for note in _delay_found(flight)],
        write=write,
    )


def _fly_all(configs: "list[FlightConfig]", seed: int) -> "list[FlightResult]":
    """Simulate scenarios that begin and end alike, one after the other, behind one progress bar."""
    from diagrams.loop.flight_result import fly as simulate

    flights, first = [], configs[0]
    with progress(f"flying {first.name} with {first.controller.name}", len(configs) * first.end) as advance:
        for k, own in enumerate(configs):

            def tell(t: float, before: float = k * first.end) -> None:
                advance(before + t)

            flights.append(simulate(own, seed=seed, monitor=tell))
    return flights


def _fly_live(config: "FlightConfig", seed: int) -> "FlightResult":
    """Simulate in real time before a browser's eyes, until the end, `stop`, Ctrl-C or the loss of the vehicle.

    Raises: LostVehicle: where it was lost before anything was recorded.
    """
    from diagrams.loop.flight_result import FlightResult, LostVehicle
    from diagrams.loop.flight_result import fly as simulate
    from diagrams.loop.live import LiveView

    with LiveView(config) as view:
        payload = ", P the payload" if view.has_payload else ""
        say(f"watch it at {view.meshcat.web_url()}: V pushes{payload}; Esc or Ctrl-C ends it.")
        try:
            with progress(f"flying {config.name} with {config.controller.name}", config.end) as advance:
                flight = simulate(
                    config, seed=seed, monitor=lambda t: advance(t, f"{100 * view.error:.1f} cm off"), watch=view
                )
        except LostVehicle as lost:
            if not len(lost.signals["t"]):
                raise
            say(str(lost))
            return FlightResult(config, seed, lost.signals)
    if view.stopped:
        say(f"stopped at {flight.signals['t'][-1]:.1f} s.")
    return flight


def _delay_found(flight: "FlightResult") -> list[str]:
    """Return a line about the delay of commands with which the controller reckoned at the end, where there was one."""
    from np_drake.command_delay import LONGEST_DELAY

    if flight.delay == 0.0:
        return []
    longest = LONGEST_DELAY * flight.config.controller.period
    more = " or later, the latest that is looked for" if flight.delay > longest - 1e-9 else ""
    return [f"the controller takes commands to act {1e3 * flight.delay:.3g} ms late{more}"]


def _require_mcap_output(file: Path) -> None:
    """Check before the flight that an MCAP file can be written.

    Raises: ValueError: if it is not so; OSError: if it cannot be written.
    """
    from np_drake.files.atomic_file import require_writable
    from np_drake.logs.formats.mcap_file import require_mcap

    require_mcap(file)
    require_writable(file)
    if file.suffix != ".mcap":
        raise ValueError(f"--mcap: must be a file whose name ends in .mcap; got {file}.")


def _default_controller(config: "FlightConfig", predictor: Path | None) -> str:
    """Return `np` where there is a model for the vehicle, else `hold`, which needs none, and say so.

    The packaged model knows the paper's vehicle.
    """
    from diagrams.loop.controllers import make_residual_model

    if predictor is not None:
        return "np"
    try:
        make_residual_model(dc.replace(config.controller, kind="np"), config.vehicle)
    except ValueError:
        say(
            f"controller: hold, as the packaged predictor is for the paper's vehicle and not for "
            f"{config.vehicle.name}; np-drake train LOG makes one of its own."
        )
        return "hold"
    return "np"


def named_solver(experiment: str) -> str | None:
    """Return the solver that a scenario names; None where it names none."""
    from diagrams.loop.experiments import EXPERIMENTS, FOLDER
    from np_drake.files.yaml_text import read_yaml

    file = FOLDER / f"{experiment}.yaml" if experiment in EXPERIMENTS else experiment
    return (read_yaml(file).get("controller") or {}).get("solver")


def as_config(config: "FlightConfig") -> dict:
    """Return the scenario as plain data, for `--json`."""
    from diagrams.loop.experiments import settings_of

    kept = ("integration_scheme", "max_step_size", "accuracy")
    return settings_of(config) | {"simulator": {name: getattr(config.simulator, name) for name in kept}}


def flights_table(flights: "Sequence[FlightResult]") -> Table:
    """Return a table with a line for every flight: errors in cm, solve times in ms."""
    lines = [{"name": f.config.name, "controller": f.label, **f.metrics()} for f in flights]
    columns: tuple[Column, ...] = (
        ("experiment", "name"),
        ("controller", "controller"),
        ("E_xy [cm]", lambda line: round(100 * line["E_xy"], 2)),
        ("E_z [cm]", lambda line: round(100 * line["E_z"], 2)),
        ("solve [ms]", lambda line: line["solve_ms"]["median"]),
        ("p95 [ms]", lambda line: line["solve_ms"]["p95"]),
        ("failed", "solve_failures"),
    )
    return tabulate(f"seed {flights[0].seed}, {flights[0].config.controller.solver}", lines, columns)


def _write_flight(flight: "FlightResult", folder: Path) -> None:
    """Write flight log, track, errors, wrench and replay page, named by experiment and controller."""
    from diagrams.loop.replay.flight_page import write_replay
    from diagrams.tracking import figures
    from np_drake.files.figure_file import save
    from np_drake.logs.formats.log_file import write_log

    stem = f"{flight.config.name}_{flight.label.replace(' + ', '_').replace(' ', '_')}"
    write_log(flight.log(), folder / f"{stem}.csv")
    title = f"{flight.config.name} · {flight.label} · seed {flight.seed}"
    save(figures.plane_track([flight], title), folder / f"{stem}_track.png")
    save(figures.errors([flight], title), folder / f"{stem}_errors.png")
    save(figures.wrench(flight), folder / f"{stem}_wrench.png")
    write_replay(flight, folder / f"{stem}_replay.html")
    say(f"log, figures, replay: {folder}/{stem}*")
