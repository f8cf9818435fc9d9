"""Lemniscate experiment: `scenarios/lemniscate.yaml`."""

from pydrake.systems.framework import Diagram

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig, make_flight_diagram
from systems.recorder import Recorder


def make_lemniscate_diagram(config: FlightConfig | None = None) -> tuple[Diagram, Recorder]:
    """Return the closed loop of the lemniscate flight, by default that of `lemniscate.yaml`, and its recorder."""
    return make_flight_diagram(config or load_experiment("lemniscate"))
