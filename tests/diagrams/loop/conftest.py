"""Flights that several tests look at, each flown once."""

import pytest

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_result import fly


def short(track="circle", kind="nominal", *, ramp=0.5, duration=0.5, **changes):
    """Return a short flight of an experiment."""
    config = load_experiment(track)
    config.duration, config.reference.ramp = duration, ramp
    config.controller.kind, config.controller.solver = kind, "sqp"
    for name, value in changes.items():
        setattr(config, name, value)
    return config


@pytest.fixture(scope="session")
def flown():
    """Maker of flights that nobody changes."""
    known = {}

    def get(*names, seed=2, **how):
        key = (names, seed, repr(how))
        if key not in known:
            known[key] = fly(short(*names, **how), seed=seed)
        return known[key]

    return get
