"""Fixtures: simulated flights (`simulated_flights.py`), their residuals, and the models that explain them."""

import dataclasses as dc
import importlib.util
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from np_drake import attitude
from np_drake.diagnosis.fitting.map_estimate import Fit
from np_drake.diagnosis.numerics.autoregressive_noise import NoiseModel, fit_noise
from np_drake.diagnosis.residuals.flight_residuals import FlightResiduals, make_flight_residuals
from np_drake.diagnosis.selection.ranking import Ranking, rank
from np_drake.effects.base import Effect
from np_drake.effects.library import LIBRARY
from np_drake.logs.flight_log import FlightLog
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
Fly = Callable[..., FlightLog]


@pytest.fixture(scope="session")
def fly() -> Fly:
    """Return the function that simulates a flight."""
    spec = importlib.util.spec_from_file_location(
        "simulated_flights", Path(__file__).with_name("simulated_flights.py")
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.fly


@pytest.fixture(scope="session")
def seen(fly: Fly) -> Callable[..., FlightResiduals]:
    """Return a function that simulates a flight and computes its residuals."""

    def simulate(*effects: Effect, vehicle: Vehicle = VEHICLE, **how: Any) -> FlightResiduals:
        return make_flight_residuals(fly(*effects, vehicle=vehicle, **how), vehicle)

    return simulate


@dc.dataclass(frozen=True)
class Case:
    """Flights of one vehicle, and the models that explain them, best first."""

    flights: list[FlightResiduals]
    held_out: list[FlightResiduals]
    ranking: Ranking

    @property
    def fit(self) -> Fit:
        return self.ranking.fits[0]


@pytest.fixture(scope="session")
def ranked(seen) -> Callable[..., Case]:
    """Return a function that ranks models on two noisy flights under some effects, with a third held out; cached."""

    @cache
    def case(*effects: Effect) -> Case:
        how = {"noise": 1.0, "seconds": 10.0}
        flights = [seen(*effects, name=n, seed=i, **how) for i, n in enumerate(("a", "b"), start=1)]
        return Case(flights, [seen(*effects, name="c", seed=3, **how)], rank(flights))

    return case


@pytest.fixture(scope="session")
def noise(seen) -> NoiseModel:
    """Return the noise model of nominal flights."""
    nominal = [seen(name=str(i), seed=i, noise=1.0) for i in (8, 9)]
    return fit_noise([e.y for e in nominal], nominal[0].grid.step)


@pytest.fixture
def library() -> Iterator[dict[str, type[Effect]]]:
    """Yield the library, and restore it after the test."""
    before = dict(LIBRARY)
    yield LIBRARY
    LIBRARY.clear()
    LIBRARY.update(before)


def _process(rng: np.random.Generator, t: np.ndarray, time: float) -> np.ndarray:
    """Return an exact first-order Gauss-Markov process (n, 3) of unit deviation."""
    decay = np.exp(-np.diff(t) / time)
    out = [rng.standard_normal(3)]
    for a in decay:
        out.append(a * out[-1] + np.sqrt(1 - a**2) * rng.standard_normal(3))
    return np.array(out)


@pytest.fixture(scope="session")
def pushed() -> Callable[..., dict[str, np.ndarray]]:
    """Return a function that gives residuals (m, 15) of flights with noise and gusts of 0.5 N about a mean.

    The force begins at `begin` [s].
    """

    def residual_of(flights, rng, time, *, begin=-np.inf, white=0.05) -> dict[str, np.ndarray]:
        residual = {}
        for e in flights:
            gusts = 0.5 * _process(rng, e.t, time) + white * rng.standard_normal((len(e.t), 3))
            force = np.array([0.3, -0.2, 0.1]) + gusts
            residual[e.name] = np.zeros_like(e.y)
            residual[e.name][:, :3] = attitude.rotate_back(e.q, force * (e.t >= begin)[:, None])
        return residual

    return residual_of
