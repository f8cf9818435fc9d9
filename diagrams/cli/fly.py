"""`np-drake fly`: simulate one experiment with one controller."""

import dataclasses as dc
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from diagrams.cli import options
from diagrams.cli.output import make_folder, print_table, progress, require_folder, say, write_metrics
from np_drake.atomic_file import require_writable

if TYPE_CHECKING:
    from diagrams.cooperative.config import CooperativeConfig
    from diagrams.loop.flight import FlightConfig
    from diagrams.loop.flight_result import FlightResult


def fly(
    experiment: Annotated[
        str, typer.Argument(help="circle, lemniscate, hover, … or a scenario file (YAML).")
    ],
    controller: Annotated[
        str | None,
        typer.Option(
            help="nominal | hold | observer | oracle | np | gp | knode; default: the scenario's, or np."
        ),
    ] = None,
    solver: Annotated[
        str | None,
        typer.Option(help="ipopt | sqp | ipopt_multiple_shooting (the test oracle: 0.2 to 1 s a solve)"),
    ] = None,
    predictor: Annotated[Path | None, typer.Option(help="Model file of controller np, gp or knode.")] = None,
    told_mass: Annotated[
        bool, typer.Option("--told-mass", help="Tell controller and estimator the payload's mass.")
    ] = False,
    duration: Annotated[float | None, typer.Option(help="Scored time after the ramp [s].")] = None,
    vehicle: options.VehicleFile = None,
    seed: options.Seed = 0,
    out: options.Out = None,
    json: options.Json = None,
) -> None:
    """Simulate an experiment; with --out: flight log, figures and a 3-D replay page."""
    if json is not None:
        require_writable(json)
    from diagrams.loop.controllers import make_residual_model
    from diagrams.loop.experiments import EXPERIMENTS, load_experiment
    from diagrams.loop.flight_result import fly as run
    from np_drake.vehicle import load_vehicle

    config = load_experiment(experiment)
    if controller is not None or experiment in EXPERIMENTS:
        config.controller.kind = controller or "np"
    if solver is not None:
        config.controller.solver = solver
    if predictor is not None:
        config.controller.predictor = str(predictor)
    if told_mass:
        config.controller.extra_mass = config.reality.payload.mass
    if duration is not None:
        config.duration = duration
    if vehicle is not None:
        config.vehicle = load_vehicle(vehicle)
    config.check()
    make_residual_model(
        config.controller, config.controller.believed(config.vehicle)
    )  # refused before any work
    if out is not None:
        require_folder(out)
    with progress(f"flying {config.name} with {config.controller.kind}", config.end) as advance:
        flight = run(config, seed=seed, monitor=advance)
    print_flights([flight])
    if out is not None:
        write_flight(flight, make_folder(out))
    summary = flight.summary()
    write_metrics(json, "fly", config=as_config(config), **summary)


def as_config(config: "FlightConfig | CooperativeConfig") -> dict:
    """The scenario as plain data, for `--json`."""
    simulator = {k: getattr(config.simulator, k) for k in ("integration_scheme", "max_step_size", "accuracy")}
    parts = {f.name: getattr(config, f.name) for f in dc.fields(config) if f.name != "simulator"}
    plain = {
        k: dc.asdict(v) if dc.is_dataclass(v) and not isinstance(v, type) else v for k, v in parts.items()
    }
    return {**plain, "simulator": simulator}


def print_flights(flights: "list[FlightResult]") -> None:
    """One line a flight: errors in cm, solve times in ms."""
    rows = []
    for flight in flights:
        m = flight.metrics()
        rows.append(
            (
                flight.config.name,
                flight.label,
                round(100 * m["E_xy"], 2),
                round(100 * m["E_z"], 2),
                m["solve_ms"]["median"],
                m["solve_ms"]["p95"],
                m["solve_failures"],
            )
        )
    header = [
        "experiment",
        "controller",
        "E_xy [cm]",
        "E_z [cm]",
        "solve [ms]",
        "p95 [ms]",
        "failed",
    ]
    print_table(f"seed {flights[0].seed}, {flights[0].config.controller.solver}", header, rows)


def write_flight(flight: "FlightResult", folder: Path) -> None:
    """Flight log, track, errors, wrench and replay page, named by experiment and controller."""
    from diagrams.loop.replay_page import write_replay
    from diagrams.tracking import figures
    from np_drake.figure_file import save
    from np_drake.logs.log_file import write_log

    stem = f"{flight.config.name}_{flight.label.replace(' + ', '_').replace(' ', '_')}"
    write_log(flight.log(), folder / f"{stem}.csv")
    title = f"{flight.config.name} · {flight.label} · seed {flight.seed}"
    save(figures.plane_track([flight], title), folder / f"{stem}_track.png")
    save(figures.errors([flight], title), folder / f"{stem}_errors.png")
    save(figures.wrench(flight), folder / f"{stem}_wrench.png")
    write_replay(flight, folder / f"{stem}_replay.html")
    say(f"log, figures, replay: {folder}/{stem}*")
