"""The circle experiment: `scenarios/circle.yaml`."""

from pydrake.systems.framework import Diagram

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig, make_flight_diagram
from systems.recorder import Recorder


def make_circle_diagram(config: FlightConfig | None = None) -> tuple[Diagram, Recorder]:
    """The closed loop of the circle flight and the recorder that reads it back; as `circle.yaml` by default."""
    return make_flight_diagram(config or load_experiment("circle"))
