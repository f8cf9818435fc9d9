"""`np-drake identify`: what flight logs tell of a vehicle, as a vehicle file."""

import dataclasses as dc
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from typer import Argument, Option

from diagrams.batch.run import FailedRun, require
from diagrams.cli.verb import (
    LogMap,
    Order,
    Propeller,
    Props,
    Report,
    Run,
    Table,
    Wheelbase,
    noted,
    progress,
    reports,
    require_once,
    say,
    write_metrics,
)
from diagrams.evidence.studies.options import tabulate
from diagrams.identification.identification_page import (
    agreement,
    change,
    half_width,
    interval,
    not_told,
    summary,
    write_page,
)
from np_drake.files.file_access import plain
from np_drake.flight_log import FlightLog
from np_drake.identification.flight_agreement import FlightValues, flight_values, own_values
from np_drake.identification.identified_vehicle import identified_vehicle
from np_drake.identification.identify import (
    REMEDY,
    SHORTEST,
    Identification,
    doubts,
    lasts,
    trades,
    unfit,
)
from np_drake.identification.identify import identify as identified
from np_drake.identification.quantities import Identified
from np_drake.identification.signals import common_drive, left_out, signals
from np_drake.identification.validation import HeldOut
from np_drake.identification.validation import held_out as errors_on
from np_drake.logs.formats.format import NO_FLIGHT
from np_drake.logs.importing.log_map import load_map_file
from np_drake.logs.opening import Opened, read_as_logged, with_vehicle
from np_drake.logs.rotors import tell_directions
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.estimate import HEAVIEST, LIGHTEST, Measured, estimate
from np_drake.vehicle.rotor_layout import PROPS, directions_of
from np_drake.vehicle.text import save_vehicle

FILE = "vehicle.yaml"
JSON = "identification.json"
SCHEMA = "identification"
# shares of the bar
READ = 0.3
FITTED = 0.8
UNTOLD = "none tells which way the propellers turn; those of the vehicle count, or give --props"
LAST = 2 / 3  # share of a single flight that is fitted; own choice


@reports(SCHEMA, seed=None, out="Folder for vehicle.yaml, page, figures and JSON.")
def identify(
    run: Run,
    logs: Annotated[
        list[Path],
        Argument(metavar="LOG...", help="Flights of one vehicle, of any format of `import`."),
    ],
    vehicle: Annotated[
        Path | None,
        Option(
            "--vehicle",
            metavar="VEHICLE",
            help="File or preset with rotors' places, directions, radius and mass; default: an X "
            "frame of --wheelbase, --propeller, --order and --mass.",
        ),
    ] = None,
    wheelbase: Wheelbase = None,
    propeller: Propeller = None,
    order: Order = None,
    props: Props = None,
    mass: Annotated[
        float | None, Option(help="Mass with battery [kg]; default: the vehicle file's.")
    ] = None,
    trust: Annotated[
        str,
        Option(
            metavar="WHICH",
            help="mass | thrust (logged newtons, or the file's coefficient, tell the mass).",
        ),
    ] = "mass",
    held_out: Annotated[
        list[Path] | None,
        Option(
            metavar="LOG",
            help="To judge by; default: the last, or the last third of a single one. Repeatable.",
        ),
    ] = None,
    input: Annotated[
        str,
        Option(
            metavar="KIND",
            help="rotor_speed | throttle | command | collective; default: the first of all logs.",
        ),
    ] = "",
    log_map: LogMap = None,
    name: Annotated[str, Option(help="Name of the vehicle.")] = "identified",
) -> Report:
    """Identify mass or thrust, inertia, motors, delays and sensors of a vehicle from its
    flights.
    """
    with progress("identifying", 1.0) as advance:
        judges = held_out or []
        require_once([*logs, *judges])
        common_drive([], input)  # refuses what is no input before logs are read
        _check_mass(mass, trust, vehicle)
        frame = {"wheelbase": wheelbase, "propeller": propeller, "order": order, "mass": mass}
        prior = _prior_of(vehicle, frame, props)
        mass = None if trust == "thrust" else mass or prior.mass
        read = _read_logs([*logs, *judges], log_map, advance)
        prior = _with_stated_props(prior, read, props, known=vehicle is not None)
        opened = [found.flights for found in with_vehicle(read, prior)]
        judging = [log for found in opened[len(logs) :] for log in found]
        flown = [log for flights in opened for log in flights]
        drive = common_drive(flown, input)
        require(
            trust == "mass" or drive in ("rotor_speed", "command"),
            f"--trust thrust: {drive} tells no newtons without a measured coefficient; "
            f"give --mass.",
        )
        fitted, judging, last, said = _split(opened[: len(logs)], judging, prior, drive)
        advance(READ, f"{len(fitted)} flight{'s' if len(fitted) > 1 else ''}")
        trusted = trust == "thrust"
        stop, parts = (LAST, [(LAST, 1.0)]) if last else (1.0, [])
        found = identified(fitted, prior, mass=mass, trusted=trusted, drive=drive, stop=stop)
        advance(FITTED, "judging")
        rows = errors_on(found, judging, parts)
        advance(1.0)
    untold = [] if tell_directions(flown, prior) else [UNTOLD]
    unused = [] if input else left_out(flown, drive)
    warnings = noted(flown, [*untold, *unused, *said, *found.notes])
    config: dict[str, Any] = {
        "logs": logs,
        "vehicle": prior.name,
        "mass": mass,
        "trust": trust,
        "input": drive,
        "held_out": [log.name for log in judging],
        "map": log_map,
    }
    own = None
    failure = None
    try:
        own = identified_vehicle(found, name)
    except ValueError as error:  # its values are none's
        failure = FailedRun(f"no {FILE}: {' '.join(str(error).split())}")
    metrics = as_json(found, rows)

    def write(folder: Path) -> None:
        (folder / FILE).unlink(missing_ok=True)  # of an earlier identification
        if own is not None:
            save_vehicle(own, folder / FILE)
            say(f"vehicle file: {folder / FILE}")
        write_metrics(folder / JSON, SCHEMA, seed=run.seed, config=config, **metrics)
        say(f"page: {write_page(found, rows, folder, thirds=bool(parts), warnings=warnings)}")

    return Report(
        [table for table in _tables(found, rows) if table[-1]],
        config=config,
        metrics=metrics,
        lines=[*summary(found), *filter(None, [change(rows)])],
        warnings=warnings,
        write=write,
        failure=failure,
    )


def _check_mass(mass: float | None, trust: str, vehicle: Path | None) -> None:
    """Check that mass, what is trusted and the vehicle go together."""
    require(trust in ("mass", "thrust"), f"--trust must be mass or thrust; got {trust!r}.")
    require(
        mass is None or LIGHTEST <= mass <= HEAVIEST,
        f"--mass must be {LIGHTEST:g} to {HEAVIEST:g} kg; got {mass}.",
    )
    require(mass is None or trust == "mass", "--trust thrust: tells the mass; leave --mass out.")
    require(vehicle or trust == "mass", "--trust thrust: give --vehicle, whose thrust is known.")


def _prior_of(vehicle: Path | None, measures: dict[str, Any], props: str | None) -> Vehicle:
    """Return the vehicle whose geometry is given, in a file or by four measures.

    Raises: ValueError: where these do not go together.
    """
    require(props in (None, *PROPS), f"--props must be in or out; got {props!r}.")
    given = {f"--{name}": value is not None for name, value in measures.items()}
    if vehicle is None:
        missing = ", ".join(option for option, there in given.items() if not there)
        require(not missing, f"give --vehicle FILE, or {missing} as well: the frame and its mass.")
        frame = Measured(hover_throttle=0.5, props=props or "in", **measures)
        return estimate(frame, f"frame of {frame.wheelbase:g} m")
    beside = ", ".join(option for option, there in given.items() if there and option != "--mass")
    require(not beside, f"--vehicle: holds the rotors' places; leave {beside} out.")
    prior = load_vehicle(vehicle)
    return prior if props is None else _turning(prior, props)


def _turning(vehicle: Vehicle, props: str) -> Vehicle:
    """Return the vehicle with propellers that turn in or out at the front."""
    return dc.replace(vehicle, rotor_directions=directions_of(vehicle.rotor_positions, props))


def _read_logs(paths: list[Path], log_map: Path | None, advance: Any) -> list[Opened]:
    """Return the logs as they are logged.

    Raises: ValueError: where the rotors of a log do not turn, with what would tell the vehicle.
    """
    declared = None if log_map is None else load_map_file(log_map)
    read = []
    for number, path in enumerate(paths):
        advance(READ * number / len(paths), f"reading {path.name}")
        read.append(read_as_logged(path, declared))
        logs = read[-1].flights
        notes = {note for log in logs for note in log.notes if note.startswith(NO_FLIGHT)}
        require(not notes, f"{path}: {' '.join(notes)}. {REMEDY}")
        inputs = [log.rotor if log.rotor is not None else log.throttle for log in logs]
        require(
            any(values is None or (values > 0).any() for values in inputs),
            f"{path}: its rotors do not turn, as on a desk, so that it tells nothing. {REMEDY}",
        )
    return read


def _with_stated_props(
    prior: Vehicle, read: list[Opened], props: str | None, *, known: bool
) -> Vehicle:
    """Return the vehicle with its propellers turning as the logs state, unless its file is known.

    Raises: ValueError: where an option contradicts a log.
    """
    logs = [log for found in read for log in found.flights]
    stated = [(log.name, log.layout) for log in logs if log.layout and log.layout.props]
    for name, layout in stated:
        require(
            props in (None, layout.props),
            f"--props {props}: the propellers of {name} turn {layout.props} at the front "
            f"({layout.source}). Leave --props out.",
        )
    return prior if known or not stated else _turning(prior, stated[0][1].props)


def _split(
    logs: list[list[FlightLog]], held_out: list[FlightLog], vehicle: Vehicle, drive: str
) -> tuple[list[FlightLog], list[FlightLog], bool, list[str]]:
    """Return flights to fit and those to judge by, whether these are the last third of a single
    one, and what is left out.

    Args:
        logs: flights of each log to fit; a log with gaps has several.
        held_out: flights to judge by; none: the last log, or the last third of a single flight.
    """
    flights = [log for found in logs for log in found]
    short = [log for log in (*flights, *held_out) if lasts(log) < SHORTEST]
    said = [f"{log.name}: shorter than {SHORTEST:g} s; left out" for log in short]
    judges = [log for log in held_out if lasts(log) >= SHORTEST]
    if held_out and not judges:
        raise ValueError(
            f"--held-out: must last {SHORTEST:g} s at least; got {lasts(held_out[0]):.2g} s."
        )
    long = [kept for found in logs if (kept := [log for log in found if lasts(log) >= SHORTEST])]
    most = max(map(lasts, flights), default=0.0)
    require(long, f"needs a flight of {SHORTEST:g} s at least; the longest lasts {most:.2g} s.")
    fitted = [log for kept in long for log in kept]
    single = False
    if not judges and len(fitted) > 1:
        last = len(long[-1]) if len(long) > 1 else 1
        fitted, judges = fitted[:-last], fitted[-last:]
    elif not judges and LAST * lasts(fitted[0]) >= SHORTEST:
        judges = fitted
        single = True
    elif not judges:
        said.append(f"{fitted[0].name}: too short to hold a third of it out")
    start = LAST if single else 0.0
    kept = []
    for log in judges:
        reason = unfit(signals(log, vehicle.unmixer, drive).part(start, 1.0), 1.0 - start)
        said += [f"{log.name}: {reason}; does not judge"] if reason else []
        kept += [] if reason else [log]
    return fitted, kept, single, said


def _tables(found: Identification, rows: list[HeldOut]) -> list[Table]:
    """Return what is told, the rate loop of an autopilot, and the errors on what was not fitted."""
    loops = zip(("roll", "pitch", "yaw"), found.rate_loop, strict=False)
    return [
        tabulate(
            "vehicle",
            found.quantities,
            (
                ("quantity", lambda q: q.title),
                ("value", lambda q: interval(q)[0]),
                ("95 %", lambda q: half_width(q, q.low, q.high)),
                ("prior", lambda q: half_width(q, *q.prior)),
                ("told by", lambda q: "flights" if q.observable else "prior"),
                ("flights", agreement),
            ),
        ),
        tabulate(
            "rate loop: when 63 % of a step of the command is followed, and rate over command",
            ({"axis": axis, **vars(one)} for axis, one in loops),
            (
                ("axis", "axis"),
                ("lag [ms]", lambda one: 1e3 * one["lag"]),
                ("95 %", lambda one: _span(1e3 * lag for lag in one["lag_interval"])),
                ("gain [1]", "gain"),
                ("95 %", lambda one: _span(one["gain_interval"])),
                ("explains", lambda one: f"{100 * one['share']:.0f} %"),
            ),
        ),
        tabulate(
            "held out: RMS of the residual, median errors of open-loop prediction",
            rows,
            (
                ("flight", lambda row: row.flight),
                ("model", lambda row: row.model),
                ("force [N]", lambda row: float(np.linalg.norm(row.force))),
                ("torque [N·m]", lambda row: float(np.linalg.norm(row.torque))),
                ("0.1 s [m]", lambda row: row.open_loop[0, 0]),
                ("0.5 s [m]", lambda row: row.open_loop[1, 0]),
                ("0.1 s [deg]", lambda row: np.rad2deg(row.open_loop[0, 2])),
                ("0.5 s [deg]", lambda row: np.rad2deg(row.open_loop[1, 2])),
            ),
        ),
    ]


def _span(bounds: Iterable[float]) -> str:
    low, high = bounds
    return f"{low:.3g} to {high:.3g}"


def as_json(found: Identification, rows: list[HeldOut]) -> dict[str, Any]:
    """Return the values of `--json`."""
    each = {told.quantity.name: told for told in flight_values(found)}
    content = {
        "fitted": [model.flight.name for model in found.models],
        "quantities": [_quantity(q, each.get(q.name)) for q in found.quantities],
        "by_flight": [
            {
                "name": own.quantity.name,
                "unit": own.quantity.quantity.unit,
                "agreement": own.quantity.p,
                "flights": np.transpose([own.value, own.low, own.high]),
                "apart": own.apart,
            }
            for own in own_values(found)
        ],
        "rate_loop": [
            {
                "axis": axis,
                "lag": one.lag,
                "lag95": one.lag_interval,
                "gain": one.gain,
                "gain95": one.gain_interval,
                "share": one.share,
            }
            for axis, one in zip("xyz", found.rate_loop, strict=False)
        ],
        "doubts": doubts(found),
        "trades": trades(found),
        "not_told": [
            {"names": names, "because": why, "manoeuvre": way}
            for way, names, why in not_told(found)
        ],
        "held_out": [dc.asdict(row) for row in rows],
    }
    return plain(content)


def _quantity(q: Identified, told: FlightValues | None) -> dict[str, Any]:
    """Return the values of a quantity, and what each flight tells of it alone."""
    return {
        "name": q.name,
        "field": q.quantity.field,
        "index": q.quantity.index,
        **({"rotor": dc.asdict(q.rotor)} if q.rotor else {}),
        "unit": q.quantity.unit,
        "value": q.value,
        "ci95": [q.low, q.high],
        "prior95": q.prior,
        "told": q.observable,
        "agreement": q.p,
        "flights": [] if told is None else np.transpose([told.value, told.low, told.high]),
        "apart": [] if told is None else told.apart,
    }
