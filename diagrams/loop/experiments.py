"""Experiments by name: scenario files in `diagrams/scenarios`."""

import dataclasses as dc
from pathlib import Path
from typing import Any

from diagrams.loop.flight import FlightConfig, load_flight
from np_drake.files.yaml_file import read_yaml
from np_drake.vehicle import Vehicle

FOLDER = Path(__file__).parents[1] / "scenarios"  # of the scenario files
SOLVER = "sqp"  # of a training flight whose scenario names none: the fast one
# Names of the scenario files.
EXPERIMENTS = (
    "circle",
    "lemniscate",
    "fast_lemniscate",
    "steps",
    "vertical",
    "multisine",
    "training_circle",
    "plain_circle",
    "hover",
    "hover_swing",
    "attach",
    "paper_vehicle",
)


def settings_of(config: Any) -> dict:
    """Return the settings of a flight, a dataclass, as a dictionary; the simulator's are Drake's
    own type.
    """
    simulator = config.simulator
    return dc.asdict(config) | {
        "simulator": {field.name: getattr(simulator, field.name) for field in simulator.__fields__}
    }


def load_experiment(
    name: str, vehicle: Vehicle | None = None, reality: str | Path | None = None
) -> FlightConfig:
    """Return the experiment called `name`, or the scenario file at that path.

    Args:
        name: of an experiment, or path of a scenario file.
        vehicle: flies in place of the scenario's; what the scenario does not name in SI scales with
            it.
        reality: experiment or scenario file whose vehicle flies, in its reality and by its
            simulator, in place of the scenario's, and with its controller where the scenario names
            none.
    Raises: ValueError: where there is none.
    """
    if reality is not None:
        other = load_flight(str(scenario_file(reality)))
        config = load_experiment(name, other.vehicle)
        if "controller" not in read_yaml(scenario_file(name)):
            config = dc.replace(config, controller=other.controller)
        return dc.replace(config, reality=other.reality, simulator=other.simulator).check_and_step()
    if name in EXPERIMENTS or name.endswith((".yaml", ".yml")):
        return load_flight(str(scenario_file(name)), vehicle)
    raise ValueError(
        f"experiment: must be one of {', '.join(EXPERIMENTS)} or a YAML file; got {name!r}."
    )


def scenario_file(name: str | Path) -> Path:
    """Return the scenario file of an experiment, or the path that is none's name."""
    return FOLDER / f"{name}.yaml" if str(name) in EXPERIMENTS else Path(name)


def training_flight(scenario: Path) -> FlightConfig:
    """Return the scenario; where it names no reference, on the training circle of its vehicle.

    Raises: ValueError: on a bad scenario.
    """
    config = load_experiment(str(scenario))
    named = read_yaml(scenario)
    if "reference" not in named:
        circle = load_experiment("training_circle", config.vehicle)
        config = dc.replace(
            config, reference=circle.reference, duration=named.get("duration", circle.duration)
        )
    if "solver" not in (named.get("controller") or {}):
        config.controller.solver = SOLVER
    return config.check()
