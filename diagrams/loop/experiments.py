"""Experiments by name: scenario files in `diagrams/scenarios`."""

from pathlib import Path

from diagrams.loop.flight import FlightConfig, load_flight

FOLDER = Path(__file__).parents[1] / "scenarios"  # of the scenario files
# Names of the scenario files.
EXPERIMENTS = ("circle", "lemniscate", "training_circle", "plain_circle", "hover")


def load_experiment(name: str) -> FlightConfig:
    """Return the experiment called `name`, or the scenario file at that path.

    Raises: ValueError: where there is none.
    """
    if name in EXPERIMENTS:
        return load_flight(str(FOLDER / f"{name}.yaml"))
    if name.endswith((".yaml", ".yml")):
        return load_flight(name)
    raise ValueError(f"experiment: must be one of {', '.join(EXPERIMENTS)} or a YAML file; got {name!r}.")
