"""Experiments, one a file, and the command line.

The names below are the public interface; each is imported when it is first used.
"""

from np_drake.lazy_names import lazy_names

NAMES = {
    "ControllerConfig": "diagrams.loop.controllers",
    "add_controller": "diagrams.loop.controllers",
    "FlightConfig": "diagrams.loop.flight",
    "load_experiment": "diagrams.loop.experiments",
    "make_flight_diagram": "diagrams.loop.flight_diagram",
    "fly": "diagrams.loop.flight_result",
    "DrakeReplay": "diagrams.gap.drake_replay",
}
__getattr__, __dir__ = lazy_names(__name__, NAMES)
