"""Hover experiment: `scenarios/hover.yaml`."""

from pydrake.systems.framework import Diagram

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig, make_flight_diagram
from systems.recorder import Recorder


def make_hover_diagram(config: FlightConfig | None = None) -> tuple[Diagram, Recorder]:
    """Return the closed loop of the hover flight, by default that of `hover.yaml`, and its recorder."""
    return make_flight_diagram(config or load_experiment("hover"))
