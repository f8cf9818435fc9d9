"""`np-drake identify`: what flight logs tell of a vehicle, as a vehicle file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from diagrams.cli.output import progress, say, tell
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from np_drake.flight_log import FlightLog
    from np_drake.identification.identify import Identification
    from np_drake.identification.quantities import Identified
    from np_drake.identification.validation import HeldOut
    from np_drake.vehicle import Vehicle

Out = Annotated[Path | None, Option("--out", metavar="DIR", help="Folder for vehicle.yaml, page and JSON.")]
FILE = "vehicle.yaml"
DIFFER = 0.01  # probability below which flights differ by more than chance [1]; own choice
LAST = 2 / 3  # share of a single flight that is fitted; own choice


@reports("identification", seed=None, out=Out)
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
        str, Option(metavar="FIRMWARE", help="Without a file: order of the rotors: px4 | ardupilot | betaflight | …")
    ] = "px4",
    held_out: Annotated[
        list[Path] | None,
        Option(metavar="LOG", help="Flights to judge by; default: the last, or the last third of one."),
    ] = None,
    input: Annotated[
        str, Option(metavar="KIND", help="rotor_speed | throttle | command; default: the first that the logs hold.")
    ] = "",
    log_map: Annotated[
        Path | None, Option("--map", metavar="FILE", help="Map of columns and conventions, as for `import`.")
    ] = None,
    name: Annotated[str, Option(help="Name of the vehicle.")] = "identified",
) -> Report:
    """Identify mass or thrust, inertia, motors, delays and sensors of a vehicle from its flights."""
    from np_drake.identification.identify import identify as identified

    prior, mass = _prior(vehicle, mass, wheelbase, propeller, order, trust)
    flights = _open(logs, prior, log_map)
    judging = _open(held_out, prior, log_map) if held_out else []
    with progress("identifying", 1.0) as advance:
        advance(0.1)
        fitted, judging, parts = _split(flights, judging)
        found = identified(
            fitted, prior, mass=mass, trusted=trust == "thrust" or mass is None, drive=input,
            stop=LAST if parts else 1.0,
        )  # fmt: skip
        advance(0.8)
        rows = _judge(found, judging, parts)
        advance(1.0)
    tell(*found.notes, indent="  ")

    def write(folder: Path) -> None:
        from diagrams.identification.page import write_page

        _write_vehicle(found, folder / FILE, name)
        say(f"page: {write_page(found, rows, judging, folder)}")

    config = {"logs": logs, "vehicle": prior.name, "mass": mass, "trust": trust, "input": found.basis.drive}
    return Report(
        [_table(found), *([_judged(rows)] if rows else [])],
        config=config | {"held_out": [log.name for log in judging], "map": log_map},
        metrics=as_json(found, rows),
        lines=summary(found),
        write=write,
    )


def _prior(
    vehicle: Path | None, mass: float | None, wheelbase: float | None, propeller: float | None, order: str, trust: str
) -> "tuple[Vehicle, float | None]":
    """Return the vehicle whose geometry is given, and its mass; None where it is to be told or is not known."""
    from np_drake.vehicle import load_vehicle
    from np_drake.vehicle_estimate import Measured, estimate

    if trust not in ("mass", "thrust"):
        raise ValueError(f"--trust must be mass or thrust; got {trust!r}.")
    if mass is not None and not 0 < mass < 1e4:
        raise ValueError(f"--mass must be positive, in kg; got {mass:g}.")
    if vehicle is not None:
        if wheelbase is not None or propeller is not None:
            raise ValueError("--vehicle holds the rotors' places; leave --wheelbase and --propeller out.")
        prior = load_vehicle(vehicle)
        return prior, None if trust == "thrust" else mass or prior.mass
    if wheelbase is None:
        raise ValueError("identify needs the rotors' places: give --vehicle FILE, or --wheelbase M (motor to motor).")
    diameter = propeller or 0.5 * wheelbase
    # Without a mass the file's is a guess by size, of which nothing but ratios comes out.
    guess = mass or 37.0 * (0.5 * wheelbase) ** 3 / 0.1
    prior = estimate(Measured(guess, wheelbase, diameter, 0.5, order=order), "estimate")
    return prior, None if trust == "thrust" else mass


def _open(paths: list[Path], vehicle: "Vehicle", log_map: Path | None) -> "list[FlightLog]":
    """Return the flights of logs, with the rotors in the order of the vehicle, and print what a reader derived."""
    from np_drake.logs.importing.log_map import load_map_file
    from np_drake.logs.opening import read_as_logged, with_vehicle

    declared = None if log_map is None else load_map_file(log_map)
    opened = with_vehicle([read_as_logged(path, declared) for path in paths], vehicle)
    flights = [log for found in opened for log in found.flights]
    tell(*(f"{log.name}: {note}" for log in flights for note in log.notes), indent="  ")
    return flights


def _split(
    flights: "list[FlightLog]", judging: "list[FlightLog]"
) -> "tuple[list[FlightLog], list[FlightLog], list[tuple[float, float]]]":
    """Return flights to fit, those to judge by, and the shares of these that count; none: whole flights."""
    if judging:
        return flights, judging, []
    if len(flights) > 1:
        return flights[:-1], flights[-1:], []
    return flights, flights, [(LAST, 1.0)]


def _judge(found: "Identification", judging: "list[FlightLog]", parts: list[tuple[float, float]]) -> "list[HeldOut]":
    from np_drake.identification.validation import held_out

    return held_out(found, judging, parts, plain=True)


def _write_vehicle(found: "Identification", path: Path, name: str) -> None:
    """Write the vehicle file, or say why there is none."""
    from np_drake.identification.identified_vehicle import identified_vehicle
    from np_drake.vehicle_text import save_vehicle

    path.unlink(missing_ok=True)  # of an earlier identification
    if found.basis.ratios:
        tell(f"no {path.name}: {RATIOS}")
        return
    save_vehicle(identified_vehicle(found, name), path)
    say(f"vehicle file: {path}")


RATIOS = "the mass is not known, so that all values are over it (kg counts as 1); give --mass for a vehicle file."


def _table(found: "Identification") -> "tuple[str, list[str], list[tuple[Any, ...]]]":
    """Return the table of what is told."""
    rows = [
        (q.name, unit_of(found, q), q.value, _half_width(q, q.low, q.high), _half_width(q, *q.prior),
         "flights" if q.told else "prior", "" if q.p != q.p else "agree" if q.p >= DIFFER else f"differ, p {q.p:.1g}")
        for q in found.quantities
    ]  # fmt: skip
    return "vehicle", ["quantity", "unit", "value", "95 %", "prior", "told by", "flights"], rows


def unit_of(found: "Identification", q: "Identified") -> str:
    """Return the unit of a quantity, over the mass where only ratios are told.

    Args:
        found: the identification.
        q: one of its quantities.
    """
    return f"{q.quantity.unit}/kg" if found.basis.ratios and q.quantity.per_mass else q.quantity.unit


def _half_width(q: "Identified", low: float, high: float) -> str:
    """Return half of an interval, relative where a quantity is positive."""
    if not q.quantity.positive:
        return f"± {0.5 * (high - low):.2g}"
    factor = float((high / low) ** 0.5)
    return f"± {100 * (factor - 1):.2g} %" if factor < 1.5 else f"× ÷ {factor:.2g}"


def _judged(rows: "list[HeldOut]") -> "tuple[str, list[str], list[tuple[Any, ...]]]":
    """Return the table of errors on what was not fitted."""
    import numpy as np

    def size(values: Any) -> float:
        return float(np.sqrt(np.sum(np.square(values))))

    table = [
        (
            row.flight,
            row.model,
            size(row.force),
            size(row.torque),
            *row.open_loop[:, 0],
            *np.rad2deg(row.open_loop[:, 2]),
        )
        for row in rows
    ]
    header = ["flight", "model", "force [N]", "torque [N·m]", "0.1 s [m]", "0.5 s [m]", "0.1 s [deg]", "0.5 s [deg]"]
    return "held out: RMS of the residual, median errors of open-loop prediction", header, table


def summary(found: "Identification") -> list[str]:
    """Return what a reader must know, a sentence each."""
    told = [q.name for q in found.quantities if q.told]
    lines = [f"told by the flights: {', '.join(told)}" if told else "the flights tell nothing that the prior does not"]
    ways: dict[str, list[str]] = {}
    for q in found.quantities:
        if not q.told and q.quantity.manoeuvre:
            ways.setdefault(q.quantity.manoeuvre, []).append(q.name)
    lines += [f"not told: {', '.join(names)}; {way} would tell" for way, names in ways.items()]
    differing = [q.name for q in found.quantities if q.p < DIFFER]
    if differing:
        lines.append(f"flights differ in {', '.join(differing)}; intervals hold the spread between flights")
    if found.basis.ratios:
        lines.append(RATIOS)
    return lines


def as_json(found: "Identification", rows: "list[HeldOut]") -> dict[str, Any]:
    """Return the values of `--json`.

    Args:
        found: the identification.
        rows: errors on what was not fitted.
    """
    return {
        "ratios": found.basis.ratios,
        "quantities": [
            {
                "name": q.name,
                "field": q.quantity.field,
                "index": list(q.quantity.index),
                "unit": unit_of(found, q),
                "value": q.value,
                "ci95": [q.low, q.high],
                "prior95": list(q.prior),
                "told": q.told,
                "agreement": None if q.p != q.p else q.p,
            }
            for q in found.quantities
        ],
        "held_out": [
            {"flight": r.flight, "model": r.model, "force": list(r.force), "torque": list(r.torque),
             "open_loop": [[None if x != x else float(x) for x in row] for row in r.open_loop]}
            for r in rows
        ],
    }  # fmt: skip
