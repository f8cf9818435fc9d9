"""Experiments by name, scenario files in `diagrams/scenarios`, and their numbers that are changed
most: payload, cable, speed and wind.
"""

import dataclasses as dc
from pathlib import Path
from typing import Any

from diagrams.batch.run import require
from diagrams.loop.flight import FlightConfig, load_flight
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.files.yaml_file import filled, read_yaml
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig

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


def settings_of(config: FlightConfig) -> dict[str, Any]:
    """Return the settings of a flight as a dictionary, of the simulator those that matter."""
    kept = ("integration_scheme", "max_step_size", "accuracy", "use_error_control")
    simulator = {name: getattr(config.simulator, name) for name in kept}
    return dc.asdict(config) | {"simulator": simulator}


def with_field(config: FlightConfig, name: str, value: Any) -> FlightConfig:
    """Return the scenario with a field changed, as `reference.speed`.

    Raises: ValueError: where it has none of that name, or of another kind.
    """
    for part in reversed(name.split(".")):
        value = {part: value}
    return filled(config, value)


def load_experiment(
    name: str,
    vehicle: Vehicle | None = None,
    reality: str | Path | None = None,
    *,
    checked: bool = True,
) -> FlightConfig:
    """Return the experiment called `name`, or the scenario file at that path.

    Args:
        name: of an experiment, or path of a scenario file.
        vehicle: flies in place of the scenario's; what the scenario does not name in SI scales with
            it.
        reality: experiment or scenario file whose vehicle flies, in its reality and by its
            simulator, in place of the scenario's, and with its controller where the scenario names
            none; where its payload hangs lower, an experiment flies higher.
        checked: as of `load_flight`.
    Raises: ValueError: where there is none.
    """
    if reality is not None:
        other = load_flight(str(scenario_file(reality)))
        config = load_experiment(name, other.vehicle, checked=checked)
        if "controller" not in read_yaml(scenario_file(name)):
            config = dc.replace(config, controller=other.controller)
        if name in EXPERIMENTS:  # a file of one's own flies where it says
            config = config.in_reality(other.reality)
        config = dc.replace(config, reality=other.reality, simulator=other.simulator)
        return config.check_and_step() if checked else config
    require(
        name in EXPERIMENTS or name.endswith((".yaml", ".yml")),
        f"experiment: must be one of {', '.join(EXPERIMENTS)} or a YAML file; got {name!r}.",
    )
    return load_flight(str(scenario_file(name)), vehicle, checked=checked)


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
            config,
            reference=circle.in_reality(config.reality).reference,
            duration=named.get("duration", circle.duration),
        )
    if "solver" not in (named.get("controller") or {}):
        config.controller.solver = SOLVER
    return config.check()


def with_payload(config: FlightConfig, mass: float) -> FlightConfig:
    """Return the scenario with a payload of another mass, 0: none [kg]; its cable stretches by the
    same share of its length.

    Raises: ValueError: on an impossible mass.
    """
    require(
        0 <= mass < float("inf"),
        f"--payload: must not be negative [kg] and finite; got {mass or 0:g}.",
    )
    reality = config.reality.check()
    hung = config.reality.hung
    if mass == 0.0:
        effects = [e for e in reality.effects if not isinstance(e.made, SuspendedPayload)]
        none = dc.replace(reality, payload=PayloadConfig(tether="none"), effects=effects)
        return dc.replace(config, reality=none)
    new = dc.replace(hung, tether="cable" if hung.tether == "none" else hung.tether, mass=mass)
    if any(isinstance(e.made, SuspendedPayload) for e in reality.effects):
        effects = [
            dc.replace(e, parameters={**e.parameters, "mass": mass})
            if isinstance(e.made, SuspendedPayload)
            else e
            for e in reality.effects
        ]
        return dc.replace(config, reality=dc.replace(reality, effects=effects))
    weight = new.mass / hung.mass
    new.stiffness = hung.stiffness * weight
    new.damping = hung.damping * weight
    return dc.replace(config, reality=dc.replace(reality, payload=new))
