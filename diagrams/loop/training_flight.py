"""Flight for training in a scenario that names no motion of its own."""

import dataclasses as dc
from pathlib import Path

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from np_drake.files.yaml_text import read_yaml

SOLVER = "sqp"  # where the scenario names none: the fast one


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
