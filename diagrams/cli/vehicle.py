"""`np-drake vehicle`: vehicle files from four measures, and the vehicles that come with the
package. `np-drake export`: a vehicle with its effects as a model file of another simulator.
"""

import dataclasses as dc
import itertools
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from diagrams.batch.run import require
from diagrams.cli.verb import (
    Order,
    Propeller,
    Props,
    Report,
    Run,
    Verbs,
    Wheelbase,
    option,
    print_table,
    reports,
    require_outputs,
    say,
    with_options,
)
from np_drake.files.file_access import is_regular, lock_outputs, write_text
from np_drake.files.number_text import percent
from np_drake.files.yaml_file import read_yaml
from np_drake.vehicle import Vehicle
from np_drake.vehicle.estimate import HEAD, Measured, estimate
from np_drake.vehicle.rotor_layout import FIRMWARE
from np_drake.vehicle.scaling import numbers, scales
from np_drake.vehicle.sources import without
from np_drake.vehicle.text import vehicle_rows, vehicle_text
from np_drake.vehicle.vehicle import load_vehicle, preset_names, vehicle_file

NAMES = ("sdf", "mujoco")  # of diagrams.exports.formats.FORMATS, which is imported late
MEASURES = ("mass", "wheelbase", "propeller", "hover_throttle", "order")  # that a new one needs
CHANGEABLE = ("name", "mass", "mass_uncertainty", "thrust_uncertainty")  # fields of a preset
vehicle = Verbs(help="Vehicle files: new, list, show.", add_completion=False)


@dc.dataclass(frozen=True)
class NewOptions:
    """Options of `vehicle new`."""

    mass: float | None = option("Mass with battery, without payload [kg].")
    wheelbase: Wheelbase = None
    propeller: Propeller = None
    hover_throttle: float | None = option("Throttle in hover, 0 to 1.")
    throttle_curve: str = option(
        "Thrust over throttle: quadratic (throttle is rotor speed) | linear.",
        default="quadratic",
        metavar="CURVE",
    )
    order: Order = None
    props: Props = None
    mass_uncertainty: float | None = option(
        "Standard deviation of the mass over the mass; default: 0.01, or the preset's [1]."
    )
    thrust_uncertainty: float | None = option(
        "Standard deviation of thrust over thrust; default: 0.4, or the preset's [1]."
    )
    preset: str | None = option(
        "Begin with this vehicle of `vehicle list`, or this file.", metavar="VEHICLE"
    )
    name: str | None = option("Name of the vehicle; default: mine, or the preset's.")
    out: Path | None = option("Vehicle file to write; default: print it.", metavar="FILE")


@vehicle.command("new")
@with_options
def new(asked: NewOptions) -> None:
    """Write a commented vehicle file from four measures; or a copy of a preset, with --mass of
    another mass.

    The file states how well mass and thrust are known, which a diagnosis takes into account.
    """
    given = {name: value for name, value in vars(asked).items() if value is not None}
    stated = {name: given[name] for name in CHANGEABLE if name in given}
    if asked.preset is not None:
        others = [_flag(name) for name in (*MEASURES, "props") if name in {*given} - {*stated}]
        require(
            not others,
            f"--preset: goes with --mass, --name and uncertainties alone; got {', '.join(others)}.",
        )
        text = _copy_of(asked.preset, stated)
    else:
        if missing := [_flag(name) for name in MEASURES if name not in given]:
            which = f" {'|'.join(FIRMWARE)} (whose logs you have)" if asked.order is None else ""
            raise ValueError(f"give {', '.join(missing)}{which} as well, or --preset NAME.")
        fields = {field.name for field in dc.fields(Measured)}
        measured = Measured(
            curve=asked.throttle_curve, **{name: given[name] for name in fields & {*given}}
        )
        text = vehicle_text(estimate(measured, asked.name or "mine"), HEAD)
    out = asked.out
    if out is None:
        say(text.rstrip("\n"))
        return
    require_outputs(out)
    with lock_outputs([], [out] if is_regular(out) else []):
        write_text(out, text)
    say(f"vehicle file: {out}")


def _flag(name: str) -> str:
    """Return the option of a field."""
    return f"--{name.replace('_', '-')}"


@vehicle.command("list")
def presets() -> None:
    """List the vehicles that come with the package, which --vehicle takes by name."""
    rows = []
    for name in preset_names():
        known = load_vehicle(name)
        lines = vehicle_file(name).read_text("utf-8").splitlines()
        source = next(line for line in lines if line.startswith("# Source")).split(": ", 1)[1]
        source = re.split(r",| for |;", source)[0].rstrip(".")
        arm = 100 * scales(known).length
        rows.append((name, known.mass, arm, numbers(known).thrust_to_weight, source))
    header = ["name", "mass [kg]", "arm [cm]", "thrust/weight [1]", "source"]
    print_table("vehicles", header, rows)


@vehicle.command("show")
def show(
    name: Annotated[
        str, Argument(metavar="VEHICLE", help="Name of `vehicle list`, or a vehicle file.")
    ],
) -> None:
    """Print a vehicle file, where each value comes from, its scales and the default flight that
    follows from them.
    """
    known = load_vehicle(name)
    say(vehicle_file(name).read_text(encoding="utf-8").rstrip("\n"), "")
    rows = [(row.field, row.value, row.interval, row.source) for row in vehicle_rows(name)]
    header = ["field", "value", "95 % interval", "source"]
    print_table(f"{known.name}: values", header, rows)
    print_table(known.name, ["quantity", "value"], _scale_rows(known))


def _copy_of(preset: str, changed: Mapping[str, Any]) -> str:
    """Return the file of a preset with other values by field; the inertia stays.

    Raises: ValueError: if there is no such preset, it cannot carry that mass, or an uncertainty is
        impossible.
    """
    known = load_vehicle(preset)
    sources = known.sources | dict.fromkeys(changed, "given")
    if "mass" in changed:
        sources["mass"] = f"given; that of {known.name} is {known.mass:g} kg"
    intervals = without(known.intervals, *changed)
    copy = dc.replace(known, **changed, sources=sources, intervals=intervals)
    lines = vehicle_file(preset).read_text(encoding="utf-8").splitlines()
    head = itertools.takewhile(lambda line: line.startswith("#"), lines)
    return vehicle_text(copy.check(), "\n".join(head))


def _scale_rows(known: Vehicle) -> list[tuple]:
    """Return the scales and dimensionless numbers of a vehicle, and its default flight."""
    from diagrams.loop.experiments import load_experiment

    unit = scales(known)
    number = numbers(known)
    circle = load_experiment("circle", known)
    payload = circle.reality.payload
    reference = circle.reference
    stated = [
        "not stated: the diagnosis' own" if value is None else f"{percent(value)} of the value"
        for value in (known.mass_uncertainty, known.thrust_uncertainty)
    ]
    return [
        ("length L, mean arm [m]", unit.length),
        ("time T = sqrt(L/g) [s]", unit.time),
        ("force m g [N]", unit.force),
        ("torque m g L [N·m]", unit.torque),
        ("thrust over weight [1]", number.thrust_to_weight),
        ("inertia over m L² [1]", ", ".join(f"{value:.3g}" for value in number.inertia)),
        ("yaw torque over thrust and arm [1]", number.yaw_arm),
        ("time to turn by 1 rad over T [1]", number.turn_time),
        ("mass, standard deviation", stated[0]),
        ("thrust, standard deviation", stated[1]),
        ("circle: radius [m]", reference.radius),
        ("circle: speed [m/s]", reference.speed),
        ("payload [kg]", payload.mass),
        ("tether [m]", payload.length),
        ("cable stiffness [N/m]", payload.stiffness),
        ("cable damping [N·s/m]", payload.damping),
        ("control period [s]", circle.controller.period),
        ("integrator step [s]", circle.simulator.max_step_size),
    ]


@reports("export", seed=None, files=("out",))
def export(
    run: Run,
    file: Annotated[
        str,
        Argument(
            metavar="FILE",
            help="Scenario as corrected.yaml of a diagnosis, vehicle file, or a name of "
            "`np-drake vehicle list`.",
        ),
    ],
    to: Annotated[str, Option("--format", metavar="FORMAT", help=f"{' | '.join(NAMES)}.")],
    out: Annotated[
        Path, Option("--out", metavar="FILE", help="File to write; never the one that is read.")
    ],
) -> Report:
    """Write a vehicle as SDF (Gazebo, Drake) or MJCF (MuJoCo), and say what it leaves out."""
    require(to in NAMES, f"--format must be one of {', '.join(NAMES)}; got {to!r}.")
    from diagrams.exports.formats import FORMATS, SHAPE, not_carried

    vehicle, effects = read_corrected(file)
    form = FORMATS[to]
    account = [*form.write(vehicle, effects, out), *not_carried(vehicle)]
    rows = [(line.identifier, line.how, line.note) for line in account]
    title = f"{vehicle.name} as {form.title}"
    return Report(
        [(title, ["effect", "carried", "how, or why not"], rows)] if rows else [],
        config={"vehicle": vehicle.name, "format": to},
        metrics={
            "carried": [dc.asdict(line) for line in account],
            "shape": SHAPE,
            "files": [str(out)],
        },
        summary=[] if rows else [f"{title}: no effect is left out."],
        notes=[f"shape: {SHAPE}.", f"{to}: {out}"],
    )


def read_corrected(file: str) -> tuple[Vehicle, list[Any]]:
    """Return vehicle and effects of a scenario file, vehicle file or preset, those of the vehicle's
    calibration first.

    No format knows an onset: an effect that begins in flight acts from the start, which is said.
    """
    from diagrams.loop.flight import FlightConfig, load_flight
    from np_drake.effects.calibration import in_flight

    source = vehicle_file(file)
    content: Any = None
    with suppress(OSError, ValueError):  # what is wrong in it is left to its reader
        content = read_yaml(source)
    fields = [{field.name for field in dc.fields(kind)} for kind in (FlightConfig, Vehicle)]
    if not isinstance(content, dict) or not content.keys() & (fields[0] - fields[1]):
        known = load_vehicle(file)
        return known, list(in_flight(known))
    config = load_flight(str(source))
    for effect, onset in config.reality.onsets.items():
        say(
            f"{effect.identifier}: begins at {onset:g} s in the scenario, and acts from "
            f"the start here."
        )
    effects = config.reality.everything()
    return config.vehicle, [*in_flight(config.vehicle, others=effects), *effects]
