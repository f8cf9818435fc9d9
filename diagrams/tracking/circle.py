"""Circle experiment: `scenarios/circle.yaml`."""

from pydrake.systems.framework import Diagram

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig, make_flight_diagram
from systems.recorder import Recorder


def make_circle_diagram(config: FlightConfig | None = None) -> tuple[Diagram, Recorder]:
    """Return the closed loop of the circle flight, by default that of `circle.yaml`, and its recorder."""
    return make_flight_diagram(config or load_experiment("circle"))
