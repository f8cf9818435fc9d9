"""Fixtures: simulated flights (`simulated_flights.py`), their residuals, and the models that
explain them.
"""

import dataclasses as dc
import importlib
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest

from np_drake import attitude
from np_drake.diagnosis.diagnose import Inference, conclude
from np_drake.diagnosis.fitting import Fit, free_parameters, read
from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.options import Options, Priors
from np_drake.diagnosis.residuals import FlightResiduals, make_flight_residuals
from np_drake.diagnosis.selection import Ranking, find_map_model, rank_models
from np_drake.diagnosis.selection.payload_search import SEARCH_LENGTHS
from np_drake.effects.base import Effect
from np_drake.effects.library import LIBRARY
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.estimation.noise import NoiseModel, fit_noise
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle
from tests.np_drake.diagnosis import simulated_flights

VEHICLE = Vehicle()
Fly = Callable[..., FlightLog]


@pytest.fixture(scope="session")
def fly() -> Fly:
    """Return the function that simulates a flight."""
    return simulated_flights.fly


@pytest.fixture(scope="session")
def seen(fly: Fly) -> Callable[..., FlightResiduals]:
    """Return a function that simulates a flight and computes its residuals."""

    def simulate(*effects: Effect, vehicle: Vehicle = VEHICLE, **how: Any) -> FlightResiduals:
        return make_flight_residuals(fly(*effects, vehicle=vehicle, **how), vehicle)

    return simulate


Search = Callable[..., Ranking]


def search_with_few_lengths(
    flights: Sequence[FlightResiduals], options: Options | None = None, *, still_air: bool = False
) -> Ranking:
    """Return `find_map_model` with a quarter of the tether lengths, for flights without a
    payload.
    """
    few = np.geomspace(*SEARCH_LENGTHS)[::4]
    return find_map_model(flights, options, still_air=still_air, lengths=few)


def _content(e: FlightResiduals) -> tuple[object, ...]:
    """Return what a search reads of a flight, hashable."""
    log = e.log
    arrays = (e.t, e.y, e.rows.x, e.nominal, e.outliers, e.joined, log.t, log.x, log.u, log.a)
    content = (None if a is None else a.tobytes() for a in arrays)
    return (e.name, repr(e.vehicle), log.input, e.goes_on, e.turned, e.attitude_noise, *content)


@pytest.fixture(scope="session")
def searched() -> Search:
    """Return `find_map_model`, which searches the same flights once in a module, with few
    lengths.
    """
    known: dict[tuple[object, ...], Ranking] = {}

    def search(
        flights: Sequence[FlightResiduals],
        options: Options | None = None,
        *,
        still_air: bool = False,
    ) -> Ranking:
        key = (*map(_content, flights), repr(options), still_air, *LIBRARY)
        if key not in known:
            known[key] = search_with_few_lengths(flights, options, still_air=still_air)
        return known[key]

    return search


@pytest.fixture(scope="session")
def inferred(searched: Search) -> Callable[..., Inference]:
    """Return inferences with few lengths, each worked out once."""
    known: dict[tuple[object, ...], Inference] = {}

    def inference(
        flights: Sequence[FlightResiduals],
        held_out: Sequence[FlightResiduals],
        options: Options | None = None,
    ) -> Inference:
        key = (*map(_content, flights), None, *map(_content, held_out), repr(options))
        if key not in known:
            known[key] = conclude(searched(flights, options), held_out)
        return known[key]

    return inference


@pytest.fixture(scope="module")
def quick_searches(searched: Search) -> Iterator[None]:
    """Let a diagnosis search with few lengths, and the same flights once in a module."""
    with pytest.MonkeyPatch.context() as patch:
        # By path: the package has a function so named.
        module = importlib.import_module("np_drake.diagnosis.diagnose")
        patch.setattr(module, "find_map_model", searched)
        yield


@dc.dataclass(frozen=True)
class Case:
    """Flights of one vehicle, the search for their model, and the models that explain them, best
    first.
    """

    flights: list[FlightResiduals]
    held_out: list[FlightResiduals]
    found: Ranking
    ranking: Ranking

    @property
    def fit(self) -> Fit:
        return self.ranking.fits[0]


@pytest.fixture(scope="session")
def ranked(seen) -> Callable[..., Case]:
    """Return a function that ranks models on two noisy flights under some effects, with a third
    held out; cached.
    """

    @cache
    def case(*effects: Effect) -> Case:
        how = {"noise": 1.0, "seconds": 10.0}
        flights = [seen(*effects, name=n, seed=i, **how) for i, n in enumerate(("a", "b"), start=1)]
        options = Options.for_sensors(False)
        swings = any(isinstance(e, SuspendedPayload) for e in effects)
        found = (find_map_model if swings else search_with_few_lengths)(flights, options)
        held_out = [seen(*effects, name="c", seed=3, **how)]
        return Case(flights, held_out, found, rank_models(found))

    return case


@pytest.fixture(scope="session")
def noise(seen) -> NoiseModel:
    """Return the noise model of nominal flights."""
    nominal = [seen(name=str(i), seed=i, noise=1.0) for i in (8, 9)]
    return fit_noise([e.y for e in nominal], nominal[0].grid.step)


@pytest.fixture(scope="session")
def fit_at(seen) -> Callable[..., Fit]:
    """Return a function that makes a fit at given effects, whose parameters, swings apart, have
    this covariance.
    """
    flights = [seen(name="a", seconds=4.0)]

    def fit(*effects: Effect, covariance: np.ndarray | float, priors: Priors | None = None) -> Fit:
        """covariance: (k, k), or an equal deviation of all parameters."""
        terms = tuple(Term(effect) for effect in effects)
        every = free_parameters(terms, flights, {}, priors=priors or Priors())
        free = tuple(f for f in every if not f.flight)
        if np.isscalar(covariance):
            covariance = float(covariance) ** 2 * np.eye(len(free))
        return Fit(terms, (), free, read(terms, free), np.asarray(covariance), 0.0)

    return fit


@pytest.fixture(scope="session")
def pushed() -> Callable[..., dict[str, np.ndarray]]:
    """Return a function that gives residuals (m, 15) of flights with noise and gusts of 0.5 N about
    a mean.

    The force begins at `begin` [s].
    """

    def residual_of(flights, rng, time, *, begin=-np.inf, white=0.05) -> dict[str, np.ndarray]:
        residual = {}
        for e in flights:
            gusts = 0.5 * simulated_flights.gauss_markov(
                rng, e.t, time
            ) + white * rng.standard_normal((len(e.t), 3))
            force = np.array([0.3, -0.2, 0.1]) + gusts
            residual[e.name] = np.zeros_like(e.y)
            residual[e.name][:, :3] = attitude.rotate_back(e.q, force * (e.t >= begin)[:, None])
        return residual

    return residual_of
