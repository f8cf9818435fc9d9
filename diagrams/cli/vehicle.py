"""`np-drake vehicle`: vehicle files from four measures, and the vehicles that come with the
package.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from diagrams.cli.output import Table, print_table, say
from diagrams.cli.runner import held_output
from diagrams.cli.verbs import Verbs

if TYPE_CHECKING:
    from np_drake.vehicle import Vehicle
    from np_drake.vehicle.text import Row

vehicle = Verbs(help="Vehicle files: new, list, show.", add_completion=False)
Preset = Annotated[
    str | None,
    Option(metavar="VEHICLE", help="Begin with this vehicle of `vehicle list`, or this file."),
]
MassUncertainty = Annotated[
    float | None,
    Option(
        help="Standard deviation of the mass over the mass; default: 0.01, or the preset's [1]."
    ),
]
ThrustUncertainty = Annotated[
    float | None,
    Option(help="Standard deviation of thrust over thrust; default: 0.4, or the preset's [1]."),
]


@vehicle.command("new")
def new(
    mass: Annotated[float | None, Option(help="Mass with battery, without payload [kg].")] = None,
    wheelbase: Annotated[
        float | None, Option(help="Distance from motor to motor, across the centre [m].")
    ] = None,
    propeller: Annotated[float | None, Option(help="Propeller diameter [m].")] = None,
    hover_throttle: Annotated[float | None, Option(help="Throttle in hover, 0 to 1.")] = None,
    throttle_curve: Annotated[
        str,
        Option(
            metavar="CURVE",
            help="Thrust over throttle: quadratic (throttle is rotor speed) | linear.",
        ),
    ] = "quadratic",
    order: Annotated[
        str | None,
        Option(
            metavar="AUTOPILOT",
            help="Order of the rotors in logs: px4 | ardupilot | betaflight | crazyflie.",
        ),
    ] = None,
    mass_uncertainty: MassUncertainty = None,
    thrust_uncertainty: ThrustUncertainty = None,
    preset: Preset = None,
    name: Annotated[
        str | None, Option(help="Name of the vehicle; default: mine, or the preset's.")
    ] = None,
    out: Annotated[
        Path | None, Option(metavar="FILE", help="Vehicle file to write; default: print it.")
    ] = None,
) -> None:
    """Write a commented vehicle file from four measures; or a copy of a preset, with --mass of
    another mass.

    The file states how well mass and thrust are known, which a diagnosis takes into account.
    """
    from np_drake.vehicle.estimate import Measured, commented_file
    from np_drake.vehicle.rotor_layout import FIRMWARE

    given_or_none = {"mass_uncertainty": mass_uncertainty, "thrust_uncertainty": thrust_uncertainty}
    stated = {key: value for key, value in given_or_none.items() if value is not None}
    measures = {
        "wheelbase": wheelbase,
        "propeller": propeller,
        "hover_throttle": hover_throttle,
        "order": order,
    }
    if preset is not None:
        if given := [_option(key) for key, value in measures.items() if value is not None]:
            raise ValueError(
                f"--preset: goes with --mass, --name and uncertainties alone; got "
                f"{', '.join(given)}."
            )
        text = _copy_of(preset, mass, name, stated)
    else:
        measures["mass"] = mass
        if missing := [_option(key) for key, value in measures.items() if value is None]:
            options = ", ".join(
                sorted(missing, key=lambda option: (option == "--order", option))
            )  # its choices follow
            which = f" {'|'.join(FIRMWARE)} (whose logs you have)" if order is None else ""
            raise ValueError(f"give {options}{which} as well, or --preset NAME.")
        measured = Measured(**measures, **stated, curve=throttle_curve)  # type: ignore[arg-type]
        text = commented_file(measured, name or "mine")
    _write_or_print(text, out)


def _write_or_print(text: str, out: Path | None) -> None:
    """Write a vehicle file, while no other run writes it; print it where no file is named."""
    from np_drake.files.atomic_file import write_text

    if out is None:
        say(text.rstrip("\n"))
        return
    with held_output(out):
        write_text(out, text)
    say(f"vehicle file: {out}")


@vehicle.command("list")
def presets(
    published: Annotated[
        bool, Option("--published", help="Published vehicles, and their spread, instead.")
    ] = False,
) -> None:
    """List the vehicles that come with the package, which --vehicle takes by name."""
    for table in _published_tables() if published else (_preset_table(),):
        print_table(*table)


@vehicle.command("show")
def show(
    name: Annotated[
        str, Argument(metavar="VEHICLE", help="Name of `vehicle list`, or a vehicle file.")
    ],
) -> None:
    """Print a vehicle file, where each value comes from, its scales and the default flight that
    follows from them.
    """
    from np_drake.vehicle.text import vehicle_rows
    from np_drake.vehicle.vehicle import load_vehicle, vehicle_file

    known = load_vehicle(name)
    say(vehicle_file(name).read_text(encoding="utf-8").rstrip("\n"), "")
    print_table(*_value_table(known.name, vehicle_rows(name)))
    print_table(*_scale_table(known))


def _option(key: str) -> str:
    """Return the option of a parameter."""
    return f"--{key.replace('_', '-')}"


def _copy_of(preset: str, mass: float | None, name: str | None, stated: Mapping[str, float]) -> str:
    """Return the file of a preset, with another mass and name where they are given; the inertia
    stays.

    Args:
        preset: name of `vehicle list`, or a vehicle file.
        mass: of the copy; None: the preset's [kg].
        name: of the copy; None: the preset's.
        stated: uncertainties of mass and thrust by field [1], in the place of the preset's or at
            the end.
    Raises: ValueError: if there is no such preset, it cannot carry that mass, or an uncertainty is
        impossible.
    """
    import dataclasses as dc
    import itertools

    from np_drake.vehicle.sources import without
    from np_drake.vehicle.text import vehicle_text
    from np_drake.vehicle.vehicle import load_vehicle, vehicle_file

    known = load_vehicle(preset)
    given = {
        field: value
        for field, value in {"name": name, "mass": mass, **stated}.items()
        if value is not None
    }
    sources = known.sources | dict.fromkeys(given, "given")
    if mass is not None:
        sources["mass"] = f"given; that of {known.name} is {known.mass:g} kg"
    copy = dc.replace(known, **given, sources=sources, intervals=without(known.intervals, *given))  # type: ignore[arg-type]
    lines = vehicle_file(preset).read_text(encoding="utf-8").splitlines()
    return vehicle_text(
        copy.check(), "\n".join(itertools.takewhile(lambda line: line.startswith("#"), lines))
    )


def _preset_table() -> Table:
    """Return a table with a line for every preset."""
    from np_drake.vehicle.scaling import numbers, scales
    from np_drake.vehicle.vehicle import load_vehicle, preset_names

    rows = []
    for name in preset_names():
        known = load_vehicle(name)
        rows.append(
            (
                name,
                known.mass,
                100 * scales(known).length,
                numbers(known).thrust_to_weight,
                _source(name),
            )
        )
    return "vehicles", ["name", "mass [kg]", "arm [cm]", "thrust/weight [1]", "source"], rows


def _published_tables() -> tuple[Table, Table]:
    """Return a table of the published vehicles, and one of the spread of their dimensionless
    numbers.
    """
    import dataclasses as dc

    from np_drake.vehicle.published import dimensionless, published_priors, published_vehicles

    shown = ("thrust_to_weight", "inertia", "time_constant")
    header = [
        "name",
        "mass [kg]",
        "arm [m]",
        "thrust/weight [1]",
        "J_xx/(m l²) [1]",
        "rotor lag [s]",
        "source",
    ]
    vehicles = published_vehicles()
    told = dimensionless(vehicles)
    columns = [vehicles["name"], vehicles["mass"], vehicles["arm"], *(told[name] for name in shown)]
    rows = list(zip(*columns, vehicles["source"], strict=True))
    priors = published_priors()
    spreads = [(field.name, getattr(priors, field.name)) for field in dc.fields(priors)]
    spread = [
        (name, told.count, told.median, told.deviation, *told.within()) for name, told in spreads
    ]
    names = ["number", "vehicles", "median", "deviation of the logarithm", "95 % from", "to"]
    return ("published vehicles", header, rows), ("spread", names, spread)


def _source(name: str) -> str:
    """Return the first words of a preset's source."""
    from np_drake.vehicle.vehicle import vehicle_file

    lines = vehicle_file(name).read_text(encoding="utf-8").splitlines()
    line = next(line for line in lines if line.startswith("# Source"))
    return line.split(": ", 1)[1].split(",")[0].split(" for ")[0].split(";")[0].rstrip(".")


def _stated_uncertainty(value: float | None) -> str:
    """Return what a vehicle file states of how well a figure is known."""
    return (
        "not stated: the diagnosis' own" if value is None else f"{100 * value:.3g} % of the value"
    )


def _value_table(name: str, rows: "list[Row]") -> Table:
    """Return a line for every value of a vehicle file; intervals are a column where there are
    any.
    """
    with_interval = any(row.interval for row in rows)
    header = ["field", "value", *["95 % interval"] * with_interval, "source"]
    cells = [(row.field, row.value, *[row.interval] * with_interval, row.source) for row in rows]
    return f"{name}: values", header, cells


def _scale_table(known: "Vehicle") -> Table:
    """Return the scales and dimensionless numbers of a vehicle, and its default flight."""
    from diagrams.loop.experiments import load_experiment
    from np_drake.vehicle.scaling import numbers, scales

    unit, number, circle = scales(known), numbers(known), load_experiment("circle", known)
    payload, reference = circle.reality.payload, circle.reference
    rows = [
        ("length L, mean arm [m]", unit.length),
        ("time T = sqrt(L/g) [s]", unit.time),
        ("force m g [N]", unit.force),
        ("torque m g L [N·m]", unit.torque),
        ("thrust over weight [1]", number.thrust_to_weight),
        ("inertia over m L² [1]", ", ".join(f"{value:.3g}" for value in number.inertia)),
        ("yaw torque over thrust and arm [1]", number.yaw_arm),
        ("time to turn by 1 rad over T [1]", number.turn_time),
        ("mass, standard deviation", _stated_uncertainty(known.mass_uncertainty)),
        ("thrust, standard deviation", _stated_uncertainty(known.thrust_uncertainty)),
        ("circle: radius [m]", reference.radius),
        ("circle: speed [m/s]", reference.speed),
        ("payload [kg]", payload.mass),
        ("tether [m]", payload.length),
        ("cable stiffness [N/m]", payload.stiffness),
        ("cable damping [N·s/m]", payload.damping),
        ("control period [s]", circle.controller.period),
        ("integrator step [s]", circle.simulator.max_step_size),
    ]
    return known.name, ["quantity", "value"], rows
