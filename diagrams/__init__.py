"""Experiments, one a file, and the command line.

The names below are the public interface; each is imported when it is first used.
"""

from typing import Any

from np_drake.lazy_names import lazy_name

NAMES = {
    "ControllerConfig": "diagrams.loop.controllers",
    "add_controller": "diagrams.loop.controllers",
    "FlightConfig": "diagrams.loop.flight",
    "load_experiment": "diagrams.loop.experiments",
    "make_flight_diagram": "diagrams.loop.flight_diagram",
    "simulate": "diagrams.loop.flight_result",
    "DrakeReplay": "diagrams.gap.drake_replay",
}


def __getattr__(name: str) -> Any:
    return lazy_name(__name__, NAMES, name)


def __dir__() -> list[str]:
    return sorted([*globals(), *NAMES])
