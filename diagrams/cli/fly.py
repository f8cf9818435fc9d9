"""`np-drake fly`: simulate one experiment with one controller."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from diagrams.batch.failed_run import FailedRun
from diagrams.cli import options
from diagrams.cli.flying import all_lost, fly_all, fly_linked, fly_live
from diagrams.cli.output import Table, say
from diagrams.cli.runner import Report, Run, reports
from diagrams.cli.scenario import Numbers, scenarios
from diagrams.studies.columns import Column, tabulate

if TYPE_CHECKING:
    from diagrams.loop.flight import FlightConfig
    from diagrams.loop.flight_result import FlightResult


@reports("fly", seed=0, out=options.Out, markdown=False, holds=("mcap",))
def fly(
    run: Run,
    experiment: Annotated[
        str, Argument(help="circle, lemniscate, hover, … or a scenario file (YAML).")
    ],
    controller: Annotated[
        list[str] | None,
        Option(
            metavar="KIND",
            help="nominal | hold | observer | oracle | cascade | np | payload_filter | gp | "
            "knode, or MODULE:NAME of "
            "your own; several times: fly each and compare them. Default: the scenario's, or np.",
        ),
    ] = None,
    solver: Annotated[
        str | None,
        Option(
            help="sqp | ipopt (MathematicalProgram, the reference); default: the scenario "
            f"file's, or {options.DEFAULT_SOLVER}."
        ),
    ] = None,
    predictor: Annotated[
        Path | None, Option(help="Model file of controller np, payload_filter, gp or knode.")
    ] = None,
    told_mass: Annotated[
        bool, Option("--told-mass", help="Known mass: controller and estimator have the payload's.")
    ] = False,
    duration: Annotated[float | None, Option(help="Scored time after the ramp [s].")] = None,
    payload: Annotated[
        float | None, Option(metavar="KG", help="Mass of the payload; 0: none [kg].")
    ] = None,
    length: Annotated[float | None, Option(metavar="M", help="Length of the cable [m].")] = None,
    speed: Annotated[
        float | None, Option(metavar="M/S", help="Mean speed along the track [m/s].")
    ] = None,
    wind: Annotated[
        str | None,
        Option(metavar="X[,Y,Z]", help="Mean wind, along x or as a vector in world axes [m/s]."),
    ] = None,
    autopilot: Annotated[
        str | None,
        Option(
            metavar="KIND",
            help=(
                "none | rate_loop (the vehicle file's) | betaflight (its firmware; extra "
                "autopilot)."
            ),
        ),
    ] = None,
    link: Annotated[
        str | None,
        Option(
            metavar="ADDRESS",
            help="Fly in real time what `np-drake node` commands by MAVLink; udpout:HOST:PORT.",
        ),
    ] = None,
    vehicle: options.VehicleFile = None,
    reality: options.Reality = None,
    sample: Annotated[
        int | None,
        Option(
            min=1,
            max=10_000,
            metavar="N",
            help="Fly N simulators drawn from the posterior of a corrected one.",
        ),
    ] = None,
    mcap: Annotated[
        Path | None,
        Option(
            metavar="FILE",
            help="Write the flight as MCAP for Foxglove and PlotJuggler (extra mcap).",
        ),
    ] = None,
    live: Annotated[
        bool, Option("--live", help="Fly in real time in a browser (Meshcat), and be pushed there.")
    ] = False,
) -> Report:
    """Simulate an experiment; with --out: flight log, figures and a 3-D replay page."""
    from diagrams.loop import comparison

    if link is not None and (
        controller or solver or predictor or told_mass or live or sample is not None
    ):
        others = "--controller, --solver, --predictor, --told-mass, --live and --sample"
        raise ValueError(f"give either --link, whose node has the controller, or {others}.")
    configs = scenarios(
        experiment,
        (controller or []) if link is None else ["hold"],
        vehicle=vehicle,
        reality=reality,
        solver=solver,
        predictor=predictor,
        told_mass=told_mass,
        autopilot=autopilot or (None if link is None else "rate_loop"),
        numbers=Numbers(payload, length, speed, wind, duration),
    )
    _require_one_flight(len(configs), sample=sample, mcap=mcap, live=live)
    if sample is not None:
        from diagrams.gap.corrected import drawn

        flown = drawn(configs[0], sample, run.seed)
    else:
        flown = configs
    compared, lost = len(configs) > 1, list[FailedRun]()
    if link is not None:
        return _linked(run, configs[0], link, mcap)
    flights = (
        [fly_live(configs[0], run.seed)]
        if live
        else fly_all(flown, run.seed, lost if compared else None)
    )
    if mcap is not None:
        from diagrams.loop.mcap_flight import write_flight_mcap

        write_flight_mcap(flights[0], mcap)
        say(f"MCAP: {mcap}")
    summaries = [flight.summary() for flight in flights]

    def write(folder: Path) -> None:
        for flight in flights:
            _write_flight(
                flight, folder, figures=("wrench",) if compared else ("track", "errors", "wrench")
            )
        if compared:
            say(
                f"comparison: "
                f"{comparison.write_comparison(flights, folder, lost=[str(one) for one in lost])}"
            )

    said = [comparison.sentence(flights), *filter(None, [comparison.models(flights)])]
    return Report(
        [flights_table(flights)],
        config={config.controller.name: as_config(config) for config in configs}
        if compared
        else as_config(configs[0]),
        metrics=summaries[0] if len(flown) == 1 and sample is None else {"flights": summaries},
        summary=said if compared else [],
        notes=[note for flight in flights for note in _notes(flight)],
        write=write,
        failure=all_lost(lost) if lost else None,
    )


def _linked(run: Run, config: "FlightConfig", link: str, mcap: Path | None) -> Report:
    """Fly a vehicle behind a link, and return what its autopilot has seen; errors are the node's to
    tell.
    """
    flight, table = fly_linked(config, run.seed, link)
    if mcap is not None:
        from diagrams.loop.mcap_flight import write_flight_mcap

        write_flight_mcap(flight, mcap)
    return Report(
        [table],
        config=as_config(config),
        metrics={"experiment": config.name, "autopilot": dict(table[2])},
        write=lambda folder: _write_flight(flight, folder, figures=()),
    )


def _require_one_flight(
    controllers: int, *, sample: int | None, mcap: Path | None, live: bool
) -> None:
    """Check that nothing that takes one flight is asked of several.

    Args:
        sample: of simulators, of `--sample`.
        mcap: file of `--mcap`.
    Raises: ValueError: where it is.
    """
    one = "--live, which shows" if live else "--mcap, which holds"
    if sample is not None and (live or mcap is not None):
        raise ValueError(f"give either {one} one flight, or --sample.")
    if controllers > 1 and (live or mcap is not None):
        raise ValueError(f"give either {one} one flight, or several --controller.")
    if controllers > 1 and sample is not None:
        raise ValueError("give either --sample, or several --controller.")
    if mcap is not None:
        _require_mcap_output(mcap)


def _notes(flight: "FlightResult") -> list[str]:
    """Return lines about waypoints that a flight did not pass, and about the delay of commands."""
    return [*(f"warning: {text}" for text in flight.warnings()), *_delay_found(flight)]


def _delay_found(flight: "FlightResult") -> list[str]:
    """Return a line about the delay of commands with which the controller reckoned at the end,
    where there was one.
    """
    from np_drake.command_delay import LONGEST_DELAY

    if flight.delay == 0.0:
        return []
    longest = LONGEST_DELAY * flight.config.controller.period
    more = " or later, the latest that is looked for" if flight.delay > longest - 1e-9 else ""
    return [f"the controller takes commands to act {1e3 * flight.delay:.3g} ms late{more}"]


def _require_mcap_output(file: Path) -> None:
    """Check before the flight that its MCAP file can be made.

    Raises: ValueError: if it cannot.
    """
    from np_drake.logs.formats.mcap_file import require_mcap

    require_mcap(file)
    if file.suffix != ".mcap":
        raise ValueError(f"--mcap: must be a file whose name ends in .mcap; got {file}.")


def as_config(config: "FlightConfig") -> dict:
    """Return the scenario as plain data, for `--json`."""
    from diagrams.loop.experiments import settings_of

    kept = ("integration_scheme", "max_step_size", "accuracy")
    return settings_of(config) | {
        "simulator": {name: getattr(config.simulator, name) for name in kept}
    }


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
    if any("payload" in line for line in lines):
        error = {
            kind: lambda line, kind=kind: round(100 * line["payload"][kind], 2)
            for kind in ("E_xy", "E_z")
        }
        columns = (
            *columns[:4],
            ("payload E_xy [cm]", error["E_xy"]),
            ("payload E_z [cm]", error["E_z"]),
            *columns[4:5],
            *columns[6:],
        )
    return tabulate(
        f"seed {flights[0].seed}, {flights[0].config.controller.solver}", lines, columns
    )


def _write_flight(flight: "FlightResult", folder: Path, *, figures: "Sequence[str]") -> None:
    """Write flight log, figures and replay page of a flight, named by its controller."""
    from diagrams.loop import comparison
    from diagrams.loop.replay import write_replay
    from np_drake.files.figure_file import save
    from np_drake.logs.formats.log_file import write_log

    stem = comparison.stem(flight)
    write_log(flight.log(), folder / f"{stem}.csv")
    if flight.blackbox:
        (folder / f"{stem}.bbl").write_bytes(flight.blackbox)
    for what in figures:
        save(flight.plot(what), folder / f"{stem}_{what}.png")
    write_replay(flight, folder / f"{stem}_replay.html")
    say(f"log, figures, replay: {folder}/{stem}*")
