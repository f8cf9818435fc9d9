"""The lemniscate experiment: `lemniscate.yaml` beside this file."""

from pydrake.systems.framework import Diagram

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig, make_flight_diagram
from systems.recorder import Recorder


def make_lemniscate_diagram(config: FlightConfig | None = None) -> tuple[Diagram, Recorder]:
    """The closed loop of the lemniscate flight and the recorder that reads it back; as `lemniscate.yaml` by default."""
    return make_flight_diagram(config or load_experiment("lemniscate"))
