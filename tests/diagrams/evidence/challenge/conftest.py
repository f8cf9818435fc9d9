from functools import partial

import numpy as np
import pytest

from diagrams.evidence.challenge import flight, make
from diagrams.evidence.challenge.case import VEHICLES
from diagrams.evidence.challenge.plans import draw_plan

SECONDS = 2.5


@pytest.fixture(scope="module", autouse=True)
def short_warm_up():
    """Cases are made with a short warm-up: the laws hold from any start; a settled one only takes
    longer.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(make, "Simulation", partial(flight.Simulation, warm_up=0.5))
        yield


@pytest.fixture(scope="session")
def vehicle():
    """The paper's: without lag a row's command is its thrust."""
    return VEHICLES[0]


@pytest.fixture(scope="session")
def t():
    return np.arange(round(SECONDS * 100)) / 100


@pytest.fixture(scope="session")
def plan(vehicle):
    return draw_plan(np.random.default_rng(3), vehicle, SECONDS, "aggressive_multisine")
