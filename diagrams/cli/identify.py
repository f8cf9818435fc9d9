"""`np-drake identify`: what flight logs tell of a vehicle, as a vehicle file."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from diagrams.batch.failed_run import FailedRun
from diagrams.cli import output
from diagrams.cli.output import Table, progress, say, tell
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from np_drake.flight_log import FlightLog
    from np_drake.identification.identify import Identification
    from np_drake.identification.validation import HeldOut
    from np_drake.logs.opening import Opened
    from np_drake.vehicle import Vehicle

Out = Annotated[Path | None, Option("--out", metavar="DIR", help="Folder for vehicle.yaml, page, figures and JSON.")]
FILE, JSON, SCHEMA = "vehicle.yaml", "identification.json", "identification"
LAST = 2 / 3  # share of a single flight that is fitted; own choice
READ, FITTED = 0.3, 0.8  # shares of the bar
DENSITY = 370.0  # mass over the cube of the arm [kg/m³], where the mass is not known; nothing but ratios is told then


@reports(SCHEMA, seed=None, out=Out)
def identify(
    run: Run,
    logs: Annotated[list[Path], Argument(metavar="LOG...", help="Flights of one vehicle, of any format of `import`.")],
    vehicle: Annotated[
        Path | None,
        Option("--vehicle", metavar="VEHICLE", help="File or preset with rotors' places, directions, radius and mass."),
    ] = None,
    mass: Annotated[float | None, Option(help="Mass with battery [kg]; default: the vehicle file's.")] = None,
    trust: Annotated[
        str, Option(metavar="WHICH", help="mass | thrust (logged newtons, or the file's coefficient, tell the mass).")
    ] = "mass",
    wheelbase: Annotated[float | None, Option(help="Without a file: from motor to motor, across [m].")] = None,
    propeller: Annotated[float | None, Option(help="Without a file: propeller diameter [m].")] = None,
    order: Annotated[
        str | None,
        Option(
            metavar="AUTOPILOT", help="Without a file: order of the rotors: px4 | ardupilot | betaflight | crazyflie."
        ),
    ] = None,
    held_out: Annotated[
        list[Path] | None,
        Option(metavar="LOG", help="To judge by; default: the last, or the last third of a single one. Repeatable."),
    ] = None,
    input: Annotated[
        str, Option(metavar="KIND", help="rotor_speed | throttle | command; default: the first that all logs hold.")
    ] = "",
    log_map: Annotated[
        Path | None, Option("--map", metavar="FILE", help="Map of columns and conventions, as for `import`.")
    ] = None,
    name: Annotated[str, Option(help="Name of the vehicle.")] = "identified",
) -> Report:
    """Identify mass or thrust, inertia, motors, delays and sensors of a vehicle from its flights."""
    with _earlier_named(run.out), progress("identifying", 1.0) as advance:
        from np_drake.identification.drives import common_drive
        from np_drake.identification.identify import identify as identified
        from np_drake.identification.validation import held_out as errors_on

        _require_different(logs, held_out or [])
        common_drive([], input)  # refuses what is no input before logs are read
        prior, mass = _prior(vehicle, mass, wheelbase, propeller, order, trust)
        opened, notes = _open([*logs, *(held_out or [])], prior, log_map, advance)
        flights = [log for found in opened[: len(logs)] for log in found]
        judging = [log for found in opened[len(logs) :] for log in found]
        drive = common_drive([*flights, *judging], input)
        if trust == "thrust" and (drive == "throttle" or (drive == "rotor_speed" and vehicle is None)):
            raise ValueError(f"--trust thrust: {drive} tells no newtons without a measured coefficient; give --mass.")
        fitted, judging, parts, left_out = _split(flights, judging)
        advance(READ, f"{len(fitted)} flight{'s' * (len(fitted) > 1)}")
        stop = parts[0][0] if parts else 1.0
        found = identified(fitted, prior, mass=mass, trusted=trust == "thrust", drive=drive, stop=stop)
        advance(FITTED, "judging")
        rows = errors_on(found, judging, parts, plain=True)
        advance(1.0)
    tell(*notes, *left_out, *found.notes, indent="  ")
    config = {"logs": logs, "vehicle": prior.name, "mass": mass, "trust": trust, "input": drive}
    config |= {"held_out": [log.name for log in judging], "map": log_map}
    own, failure = _vehicle(found, name)
    metrics = as_json(found, rows)

    def write(folder: Path) -> None:
        from diagrams.identification.page import write_page
        from np_drake.vehicle_text import save_vehicle

        (folder / FILE).unlink(missing_ok=True)  # of an earlier identification
        if own is not None:
            save_vehicle(own, folder / FILE)
            say(f"vehicle file: {folder / FILE}")
        output.write_metrics(folder / JSON, SCHEMA, seed=run.seed, config=config, **metrics)
        say(f"page: {write_page(found, rows, judging, folder, parts=parts)}")

    from diagrams.identification.text import change, summary

    lines = [*summary(found), *filter(None, [change(rows)])]
    tables = [_table(found), *([_judged(found, rows)] if rows else [])]
    return Report(tables, config=config, metrics=metrics, lines=lines, write=write, failure=failure)


@contextmanager
def _earlier_named(folder: Path | None) -> Iterator[None]:
    """Say with the reason of a failure that the folder's vehicle file is of an earlier run."""
    try:
        yield
    except (ValueError, OSError) as error:
        if folder is None or not (folder / FILE).is_file():
            raise
        from diagrams.cli.outcome import text_of

        raise ValueError(f"{text_of(error)} {folder / FILE} is of an earlier run.") from error


def _require_different(logs: list[Path], judging: list[Path]) -> None:
    """Check that no log is given twice.

    Raises: ValueError: where one is.
    """
    fitted, held = ([path.resolve() for path in paths] for paths in (logs, judging))
    for path in [*logs, *judging]:
        if [*fitted, *held].count(path.resolve()) > 1:
            both = path.resolve() in fitted and path.resolve() in held
            raise ValueError(f"{path}: must be given once; got it {'as LOG and as --held-out' if both else 'twice'}.")


def _prior(
    vehicle: Path | None,
    mass: float | None,
    wheelbase: float | None,
    propeller: float | None,
    order: str | None,
    trust: str,
) -> "tuple[Vehicle, float | None]":
    """Return the vehicle whose geometry is given, and its mass; None where it is to be told or is not known."""
    from np_drake.rotor_layout import FIRMWARE
    from np_drake.vehicle import load_vehicle
    from np_drake.vehicle_estimate import HEAVIEST, LIGHTEST, Measured, estimate

    if trust not in ("mass", "thrust"):
        raise ValueError(f"--trust must be mass or thrust; got {trust!r}.")
    if mass is not None and not LIGHTEST <= mass <= HEAVIEST:
        raise ValueError(f"--mass must be {LIGHTEST:g} to {HEAVIEST:g} kg; got {mass:g}.")
    if mass is not None and trust == "thrust":
        raise ValueError("--trust thrust: tells the mass; leave --mass out.")
    measures = {"--wheelbase": wheelbase, "--propeller": propeller, "--order": order}
    if vehicle is not None:
        if given := [option for option, value in measures.items() if value is not None]:
            raise ValueError(f"--vehicle: holds the rotors' places; leave {', '.join(given)} out.")
        prior = load_vehicle(vehicle)
        return prior, None if trust == "thrust" else mass or prior.mass
    if wheelbase is None:
        raise ValueError(
            "needs the rotors' places: give --vehicle FILE, or --wheelbase M (motor to motor) and --order."
        )
    if order is None:
        raise ValueError(f"give --order {'|'.join(FIRMWARE)} (whose logs you have) as well.")
    guess = min(max(DENSITY * (0.5 * wheelbase) ** 3, LIGHTEST), HEAVIEST) if wheelbase > 0 else LIGHTEST
    diameter = 0.5 * wheelbase if propeller is None else propeller
    measured = Measured(guess if mass is None else mass, wheelbase, diameter, 0.5, order=order)
    frame = estimate(measured, f"frame of {wheelbase:g} m")
    return frame if mass is not None else _over_mass(frame), mass


def _over_mass(vehicle: "Vehicle") -> "Vehicle":
    """Return the vehicle with mass 1, all forces and moments over its mass."""
    import dataclasses as dc

    m = vehicle.mass
    return dc.replace(
        vehicle,
        mass=1.0,
        inertia=(vehicle.J / m).tolist(),
        thrust_coefficient=vehicle.thrust_coefficient / m,
        torque_coefficient=vehicle.torque_coefficient / m,
        max_rotor_thrust=vehicle.max_rotor_thrust / m,
    ).check()


def _open(
    paths: list[Path], vehicle: "Vehicle", log_map: Path | None, advance: Any
) -> "tuple[list[list[FlightLog]], list[str]]":
    """Return the flights of each log, with rotors in the order of the vehicle, and what readers derived."""
    from np_drake.logs.importing.log_map import load_map_file
    from np_drake.logs.opening import read_as_logged, with_vehicle

    declared = None if log_map is None else load_map_file(log_map)
    read = []
    for number, path in enumerate(paths):
        advance(READ * number / len(paths), f"reading {path.name}")
        read.append(read_as_logged(path, declared))
        _require_turning(read[-1])
    opened = [found.flights for found in with_vehicle(read, vehicle)]
    said: dict[str, list[str]] = {}
    for log in (log for flights in opened for log in flights):
        for note in log.notes:
            said.setdefault(note, []).append(log.name)
    return opened, [f"{', '.join(names)}: {note}" for note, names in said.items()]


def _require_turning(opened: "Opened") -> None:
    """Check that the rotors of a log turn.

    Raises: ValueError: where they do not, with what would tell the vehicle.
    """
    from np_drake.identification.identify import REMEDY

    inputs = [log.rotor if log.rotor is not None else log.throttle for log in opened.flights]
    if all(values is not None and not (values > 0).any() for values in inputs):
        raise ValueError(f"{opened.path}: its rotors do not turn, as on a desk, so that it tells nothing. {REMEDY}")


def _split(
    flights: "list[FlightLog]", judging: "list[FlightLog]"
) -> "tuple[list[FlightLog], list[FlightLog], list[tuple[float, float]], list[str]]":
    """Return flights to fit, those to judge by, the shares of these that count (none: whole), and what is left out."""
    from np_drake.identification.identify import SHORTEST, lasts

    short = [log for log in [*flights, *judging] if lasts(log) < SHORTEST]
    said = [f"{log.name}: shorter than {SHORTEST:g} s; left out" for log in short]
    long, judges = ([log for log in logs if lasts(log) >= SHORTEST] for logs in (flights, judging))
    if judging and not judges:
        raise ValueError(f"--held-out: must last {SHORTEST:g} s at least; got {lasts(judging[0]):.2g} s.")
    if not long:
        raise ValueError(
            f"needs a flight of {SHORTEST:g} s at least; the longest lasts {max(map(lasts, flights)):.2g} s."
        )
    if judges:
        return long, judges, [], said
    if len(long) > 1:
        return long[:-1], long[-1:], [], said
    if LAST * lasts(long[0]) < SHORTEST:
        return long, [], [], [*said, f"{long[0].name}: too short to hold a third of it out"]
    return long, long, [(LAST, 1.0)], said


def _vehicle(found: "Identification", name: str) -> "tuple[Vehicle | None, FailedRun | None]":
    """Return the identified vehicle, or None with the reason where its values are none's."""
    from np_drake.identification.identified_vehicle import identified_vehicle

    if found.basis.ratios:
        return None, None
    try:
        return identified_vehicle(found, name), None
    except ValueError as error:
        return None, FailedRun(f"no {FILE}: {' '.join(str(error).split())}")


def _table(found: "Identification") -> Table:
    """Return the table of what is told."""
    from diagrams.identification.text import agreement, half_width, interval

    rows = [
        (q.name, interval(found, q)[0], half_width(found, q, q.low, q.high), half_width(found, q, *q.prior),
         "flights" if q.told else "prior", agreement(q))
        for q in found.quantities
    ]  # fmt: skip
    several = len(found.models) > 1
    header = ["quantity", "value", "95 %", "prior", "told by", *["flights"] * several]
    return "vehicle", header, [row[: len(header)] for row in rows]


def _judged(found: "Identification", rows: "list[HeldOut]") -> Table:
    """Return the table of errors on what was not fitted."""
    import numpy as np

    def size(values: Any) -> float:
        return float(np.sqrt(np.sum(np.square(values))))

    names = list(dict.fromkeys(row.flight for row in rows))
    several = len(names) > 1
    table: list[tuple[Any, ...]] = []
    for row in rows:
        angles = np.rad2deg(row.open_loop[:, 2])
        first = [row.flight] * several
        table.append((*first, row.model, size(row.force), size(row.torque), *row.open_loop[:, 0], *angles))
    errors = ["0.1 s [m]", "0.5 s [m]", "0.1 s [deg]", "0.5 s [deg]"]
    over = "/kg" if found.basis.ratios else ""
    header = [*["flight"] * several, "model", f"force [N{over}]", f"torque [N·m{over}]", *errors]
    which = "held out" if several else f"held out, {names[0]}"
    return f"{which}: RMS of the residual, median errors of open-loop prediction", header, table


def as_json(found: "Identification", rows: "list[HeldOut]") -> dict[str, Any]:
    """Return the values of `--json`.

    Args:
        found: the identification.
        rows: errors on what was not fitted.
    """
    from diagrams.identification.text import not_told, unit_of
    from np_drake.identification.flight_agreement import flight_values

    each = {told.quantity.name: told for told in flight_values(found)}
    quantities = []
    for q in found.quantities:
        told = each.get(q.name)
        quantities.append(
            {
                "name": q.name,
                "field": q.quantity.field,
                "index": list(q.quantity.index),
                "unit": unit_of(found, q),
                "value": q.value,
                "ci95": [q.low, q.high],
                "prior95": list(q.prior),
                "told": q.told,
                "agreement": _finite(q.p),
                "flights": []
                if told is None
                else [[_finite(v) for v in row] for row in zip(told.value, told.low, told.high, strict=True)],
                "apart": [] if told is None else list(told.apart),
                "moves_with": "" if told is None else told.moves_with,
            }
        )
    return {
        "ratios": found.basis.ratios,
        "fitted": [model.flight.name for model in found.models],
        "quantities": quantities,
        "not_told": [{"names": names, "because": why, "manoeuvre": way} for way, names, why in not_told(found)],
        "held_out": [
            {"flight": r.flight, "model": r.model, "force": list(map(float, r.force)),
             "torque": list(map(float, r.torque)), "open_loop": [[_finite(x) for x in row] for row in r.open_loop]}
            for r in rows
        ],
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return float(value) if value == value and abs(value) != float("inf") else None
