"""`np-drake export`: a vehicle with its effects as a model file of another simulator."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from diagrams.cli.output import say
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from np_drake.vehicle import Vehicle

NAMES = ("sdf", "mujoco")  # of diagrams.exports.formats.FORMATS, which is imported late


@reports("export", seed=None)
def export(
    run: Run,
    file: Annotated[
        str,
        Argument(
            metavar="FILE",
            help=(
                "Scenario as corrected.yaml of a diagnosis, vehicle file, or a name of "
                "`np-drake vehicle list`."
            ),
        ),
    ],
    to: Annotated[str, Option("--format", metavar="FORMAT", help=f"{' | '.join(NAMES)}.")],
    out: Annotated[
        Path, Option("--out", metavar="FILE", help="File to write; never the one that is read.")
    ],
) -> Report:
    """Write a vehicle as SDF (Gazebo, Drake) or MJCF (MuJoCo), and say what it leaves out."""
    if to not in NAMES:
        raise ValueError(f"--format must be one of {', '.join(NAMES)}; got {to!r}.")
    vehicle, effects = read_corrected(file)
    return export_corrected(vehicle, effects, to, out)


def read_corrected(file: str) -> tuple["Vehicle", list[Any]]:
    """Return vehicle and effects of a scenario file, vehicle file or preset: the one place where
    FILE is read.

    The effects of the vehicle's calibration come first.

    No format knows an onset: an effect that begins in flight acts from the start, which is said.
    Raises: ValueError: one line on bad content.
    """
    from np_drake.effects.calibration import in_flight
    from np_drake.vehicle.vehicle import load_vehicle, vehicle_file

    source = vehicle_file(file)
    if not _is_scenario(source):
        known = load_vehicle(file)
        return known, list(in_flight(known))
    from diagrams.loop.flight import load_flight

    config = load_flight(str(source))
    for effect, onset in config.reality.onsets.items():
        say(
            f"{effect.identifier}: begins at {onset:g} s in the scenario, and acts from "
            f"the start here."
        )
    every = config.reality.everything()
    return config.vehicle, [*in_flight(config.vehicle, beside=every), *every]


def _is_scenario(path: Path) -> bool:
    """Return whether a file names a part that a vehicle file has not; what is wrong in it is left
    to its reader.
    """
    from np_drake.files.yaml_file import read_yaml

    try:
        content = read_yaml(path)
    except (OSError, ValueError):
        return False
    parts = {"vehicle", "reality", "reference", "controller", "duration", "simulator"}
    return isinstance(content, dict) and bool(parts & content.keys())


def export_corrected(vehicle: "Vehicle", effects: Sequence[Any], to: str, out: Path) -> Report:
    """Write vehicle and effects, and return the account of each effect.
    Raises: ValueError: if the format cannot hold the vehicle.
    """
    import dataclasses as dc

    from diagrams.exports.formats import FORMATS, SHAPE, not_carried

    form = FORMATS[to]
    account = [*form.write(vehicle, effects, out), *not_carried(vehicle)]
    rows = [(line.identifier, line.how, line.note) for line in account]
    table = (f"{vehicle.name} as {form.title}", ["effect", "carried", "how, or why not"], rows)
    nothing = f"{vehicle.name} as {form.title}: no effect is left out."
    return Report(
        [table] if rows else [],
        config={"vehicle": vehicle.name, "format": to},
        metrics={
            "carried": [dc.asdict(line) for line in account],
            "shape": SHAPE,
            "files": [str(out)],
        },
        summary=[] if rows else [nothing],
        notes=[f"shape: {SHAPE}.", f"{to}: {out}"],
    )
