import importlib.util
from pathlib import Path

import numpy as np
import pytest

from diagrams.challenge.real.forecast.folds import PayloadFlight
from np_drake.effects.pendulum import Payload
from np_drake.vehicle import Vehicle

TESTS = Path(__file__).parents[4]


def _cones():
    path = TESTS / "np_drake" / "skill" / "conical_flight.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.conical_flight


@pytest.fixture(scope="session")
def payload():
    """The payload of the simulated flights."""
    return Payload(mass=0.1, length=0.6, hook=(0.0, 0.0, 0.0))


@pytest.fixture(scope="session")
def cones(payload):
    """Conical swings of three angles, two flights each: three manoeuvres of exact pendulums."""
    vehicle, found = Vehicle(), []
    for number, angle in enumerate((0.2, 0.3, 0.4)):
        for twin in range(2):
            name, v = f"{number}{twin}", np.array([0.5 * twin, 0.3 * number, 0.0])
            log, path = _cones()(vehicle, payload, angle=angle, velocity=v, name=name)
            found.append(PayloadFlight(log, vehicle, f"angle {angle}", *path))
    return found
