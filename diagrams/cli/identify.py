"""`np-drake identify`: what flight logs tell of a vehicle, as a vehicle file."""

import dataclasses as dc
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from typer import Argument

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
    option,
    progress,
    reports,
    require_once,
    say,
    write_metrics,
)
from diagrams.evidence.studies.options import tabulate
from diagrams.identification_page import (
    agreement,
    change,
    half_width,
    interval,
    not_told,
    summary,
    write_page,
)
from np_drake.files.file_access import plain
from np_drake.finding import Place, shown_at
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
from np_drake.identification.validation import HeldOutErrors, held_out_errors
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


@dc.dataclass(frozen=True)
class IdentifyOptions:
    """Options of `identify`."""

    logs: list[Path] = option(
        "Flights of one vehicle, of any format of `import`.",
        default=dc.MISSING,
        kind=Argument,
        metavar="LOG...",
    )
    vehicle: Path | None = option(
        "File or preset with rotors' places, directions, radius and mass; default: an X frame of "
        "--wheelbase, --propeller, --order and --mass.",
        metavar="VEHICLE",
    )
    wheelbase: Wheelbase = None
    propeller: Propeller = None
    order: Order = None
    props: Props = None
    mass: float | None = option("Mass with battery [kg]; default: the vehicle file's.")
    trust: str = option(
        "mass | thrust (logged newtons, or the file's coefficient, tell the mass).",
        default="mass",
        metavar="WHICH",
    )
    held_out: list[Path] = option(
        "To judge by; default: the last, or the last third of a single one. Repeatable.",
        default=(),
        metavar="LOG",
    )
    input: str = option(
        "rotor_speed | throttle | command | collective; default: the first of all logs.",
        default="",
        metavar="KIND",
    )
    log_map: LogMap = None
    name: str = option("Name of the vehicle.", default="identified")


class Split(NamedTuple):
    """Flights to fit, and flights to judge by: the last third of the same one where `last`."""

    fitted: list[FlightLog]
    judging: list[FlightLog]
    last: bool
    notes: list[str]  # on what is left out


@reports(SCHEMA, seed=None, out="Folder for vehicle.yaml, page, figures and JSON.")
def identify(run: Run, asked: IdentifyOptions) -> Report:
    """Identify mass or thrust, inertia, motors, delays and sensors of a vehicle from its
    flights.
    """
    judges = asked.held_out
    require_once([*asked.logs, *judges])
    common_drive([], asked.input)  # refuses what is no input before logs are read
    _check_mass(asked)
    prior = _prior_of(asked)
    with progress("identifying") as advance:
        logs = _read_logs([*asked.logs, *judges], asked.log_map, advance)
        prior = _with_stated_props(prior, logs, asked)
        opened = [log.flights for log in with_vehicle(logs, prior)]
        flown = [flight for flights in opened for flight in flights]
        drive = _common_drive(flown, asked)
        split = _split(opened[: len(asked.logs)], opened[len(asked.logs) :], prior, drive)
        several = "s" if len(split.fitted) > 1 else ""
        advance(READ, f"{len(split.fitted)} flight{several}")
        mass = None if asked.trust == "thrust" else asked.mass or prior.mass
        identification = identified(
            split.fitted,
            prior,
            mass=mass,
            trusted=asked.trust == "thrust",
            drive=drive,
            stop=LAST if split.last else 1.0,
        )
        advance(FITTED, "judging")
        rows = held_out_errors(identification, split.judging, LAST if split.last else 0.0)
    untold = [] if tell_directions(flown, prior) else [UNTOLD]
    unused = [] if asked.input else left_out(flown, drive)
    warnings = noted(flown, [*untold, *unused, *split.notes, *identification.notes])
    config: dict[str, Any] = {
        "logs": asked.logs,
        "vehicle": prior.name,
        "mass": mass,
        "trust": asked.trust,
        "input": drive,
        "held_out": [log.name for log in split.judging],
        "map": asked.log_map,
    }
    vehicle = None
    failure = None
    try:
        vehicle = identified_vehicle(identification, asked.name)
    except ValueError as error:  # its values are none's
        failure = FailedRun(f"no {FILE}: {' '.join(str(error).split())}")
    metrics = as_json(identification, rows)

    def write(folder: Path) -> None:
        (folder / FILE).unlink(missing_ok=True)  # of an earlier identification
        if vehicle is not None:
            save_vehicle(vehicle, folder / FILE)
            say(f"vehicle file: {folder / FILE}")
        write_metrics(folder / JSON, SCHEMA, seed=run.seed, config=config, **metrics)
        page = write_page(identification, rows, folder, thirds=split.last, warnings=warnings)
        say(f"page: {page}")

    return Report(
        [table for table in _tables(identification, rows) if table[-1]],
        config=config,
        metrics=metrics,
        lines=[*summary(identification), *filter(None, [change(rows)])],
        warnings=warnings,
        write=write,
        failure=failure,
    )


def _check_mass(asked: IdentifyOptions) -> None:
    """Check that mass, what is trusted and the vehicle go together."""
    mass = asked.mass
    trust = asked.trust
    require(trust in ("mass", "thrust"), f"--trust must be mass or thrust; got {trust!r}.")
    require(
        mass is None or LIGHTEST <= mass <= HEAVIEST,
        f"--mass must be {LIGHTEST:g} to {HEAVIEST:g} kg; got {mass}.",
    )
    require(mass is None or trust == "mass", "--trust thrust: tells the mass; leave --mass out.")
    require(
        bool(asked.vehicle) or trust == "mass",
        "--trust thrust: give --vehicle, whose thrust is known.",
    )


def _common_drive(flown: list[FlightLog], asked: IdentifyOptions) -> str:
    """Return what drives the rotors in all flights."""
    drive = common_drive(flown, asked.input)
    require(
        asked.trust == "mass" or drive in ("rotor_speed", "command"),
        f"--trust thrust: {drive} tells no newtons without a measured coefficient; give --mass.",
    )
    return drive


def _prior_of(asked: IdentifyOptions) -> Vehicle:
    """Return the vehicle whose geometry is given, in a file or by four measures.

    Raises: ValueError: where these do not go together.
    """
    props = asked.props
    require(props in (None, *PROPS), f"--props must be in or out; got {props!r}.")
    measures = {name: getattr(asked, name) for name in ("wheelbase", "propeller", "order", "mass")}
    if asked.vehicle is None:
        missing = ", ".join(f"--{name}" for name, value in measures.items() if value is None)
        require(not missing, f"give --vehicle FILE, or {missing} as well: the frame and its mass.")
        frame = Measured(hover_throttle=0.5, props=props or "in", **measures)
        return estimate(frame, f"frame of {frame.wheelbase:g} m")
    del measures["mass"]
    needless = ", ".join(f"--{name}" for name, value in measures.items() if value is not None)
    require(not needless, f"--vehicle: holds the rotors' places; leave {needless} out.")
    prior = load_vehicle(asked.vehicle)
    return prior if props is None else _turning(prior, props)


def _turning(vehicle: Vehicle, props: str) -> Vehicle:
    """Return the vehicle with propellers that turn in or out at the front."""
    return dc.replace(vehicle, rotor_directions=directions_of(vehicle.rotor_positions, props))


def _read_logs(paths: list[Path], log_map: Path | None, advance: Any) -> list[Opened]:
    """Return the logs as they are logged.

    Raises: ValueError: where the rotors of a log do not turn, with what would tell the vehicle.
    """
    declared = None if log_map is None else load_map_file(log_map)
    opened = []
    for number, path in enumerate(paths):
        advance(READ * number / len(paths), f"reading {path.name}")
        opened.append(read_as_logged(path, declared))
        logs = opened[-1].flights
        failures = {str(f) for log in logs for f in shown_at(log.findings, Place.FAILURE)}
        require(not failures, f"{path}: {' '.join(failures)}. {REMEDY}")
        inputs = [log.rotor if log.rotor is not None else log.throttle for log in logs]
        require(
            any(values is None or (values > 0).any() for values in inputs),
            f"{path}: its rotors do not turn, as on a desk, so that it tells nothing. {REMEDY}",
        )
    return opened


def _with_stated_props(prior: Vehicle, logs: list[Opened], asked: IdentifyOptions) -> Vehicle:
    """Return the vehicle with its propellers turning as the logs state, unless its file is known.

    Raises: ValueError: where an option contradicts a log.
    """
    flights = [flight for log in logs for flight in log.flights]
    stated = [(log.name, log.layout) for log in flights if log.layout and log.layout.props]
    for name, layout in stated:
        require(
            asked.props in (None, layout.props),
            f"--props {asked.props}: the propellers of {name} turn {layout.props} at the front "
            f"({layout.source}). Leave --props out.",
        )
    return prior if asked.vehicle or not stated else _turning(prior, stated[0][1].props)


def _split(
    logs: list[list[FlightLog]], held_out: list[list[FlightLog]], vehicle: Vehicle, drive: str
) -> Split:
    """Return flights to fit, and flights to judge by that tell anything.

    Args:
        logs: flights of each log to fit; a log with gaps has several.
        held_out: flights to judge by; none: the last log, or the last third of a single flight.
    """
    long = [[log for log in flights if lasts(log) >= SHORTEST] for flights in logs]
    long = [flights for flights in long if flights]
    fitted = [log for flights in long for log in flights]
    given = [log for flights in held_out for log in flights]
    judges = [log for log in given if lasts(log) >= SHORTEST]
    offered = [log for flights in logs for log in flights]
    short = [log.name for log in (*offered, *given) if lasts(log) < SHORTEST]
    notes = [f"{name}: shorter than {SHORTEST:g} s; left out" for name in short]
    if given and not judges:
        raise ValueError(
            f"--held-out: must last {SHORTEST:g} s at least; got {lasts(given[0]):.2g} s."
        )
    most = max(map(lasts, offered), default=0.0)
    require(
        bool(fitted), f"needs a flight of {SHORTEST:g} s at least; the longest lasts {most:.2g} s."
    )
    single = False
    if not judges and len(fitted) > 1:
        last = len(long[-1]) if len(long) > 1 else 1
        fitted, judges = fitted[:-last], fitted[-last:]
    elif not judges and LAST * lasts(fitted[0]) >= SHORTEST:
        judges = fitted
        single = True
    elif not judges:
        notes.append(f"{fitted[0].name}: too short to hold a third of it out")
    start = LAST if single else 0.0
    fit = []
    for log in judges:
        reason = unfit(signals(log, vehicle.unmixer, drive).part(start, 1.0), 1.0 - start)
        if reason:
            notes.append(f"{log.name}: {reason}; does not judge")
        else:
            fit.append(log)
    return Split(fitted, fit, single, notes)


def _tables(result: Identification, rows: list[HeldOutErrors]) -> list[Table]:
    """Return what is told, the rate loop of an autopilot, and the errors on what was not fitted."""
    loops = zip(("roll", "pitch", "yaw"), result.rate_loop, strict=False)
    return [
        tabulate(
            "vehicle",
            result.quantities,
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
                ("force [N]", lambda row: np.linalg.norm(row.force)),
                ("torque [N·m]", lambda row: np.linalg.norm(row.torque)),
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


def as_json(result: Identification, rows: list[HeldOutErrors]) -> dict[str, Any]:
    """Return the values of `--json`."""
    by_name = {values.quantity.name: values for values in flight_values(result)}
    content = {
        "fitted": [model.flight.name for model in result.models],
        "quantities": [_quantity(q, by_name.get(q.name)) for q in result.quantities],
        "by_flight": [
            {
                "name": values.quantity.name,
                "unit": values.quantity.quantity.unit,
                "agreement": values.quantity.p,
                "flights": np.transpose([values.value, values.low, values.high]),
                "apart": values.apart,
            }
            for values in own_values(result)
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
            for axis, one in zip("xyz", result.rate_loop, strict=False)
        ],
        "doubts": doubts(result),
        "trades": trades(result),
        "not_told": [
            {"names": names, "because": why, "manoeuvre": way}
            for way, names, why in not_told(result)
        ],
        "held_out": [dc.asdict(row) for row in rows],
    }
    return plain(content)


def _quantity(q: Identified, values: FlightValues | None) -> dict[str, Any]:
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
        "flights": [] if values is None else np.transpose([values.value, values.low, values.high]),
        "apart": [] if values is None else values.apart,
    }
