"""Experiments, one a file, and the command line.

The names below are the public interface; each is imported when it is first used.
"""

from typing import TYPE_CHECKING

from np_drake.lazy_names import lazy_names

if TYPE_CHECKING:
    from diagrams.gap.drake_replay import DrakeReplay as DrakeReplay
    from diagrams.loop.controllers import ControllerConfig as ControllerConfig
    from diagrams.loop.controllers import add_controller as add_controller
    from diagrams.loop.experiments import load_experiment as load_experiment
    from diagrams.loop.flight import FlightConfig as FlightConfig
    from diagrams.loop.flight_diagram import make_flight_diagram as make_flight_diagram
    from diagrams.loop.flight_result import fly as fly
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
