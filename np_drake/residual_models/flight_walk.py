"""Forecasts of a residual model along a whole flight, fed sample by sample as in flight.

The label of sample k is of the step that ends at t_k. A model of the labels forecasts that of sample k + i as chi_i; a
model that reads a plan forecasts the wrench from t_(k+i) to t_(k+i+1) as chi_i, which is the label of sample k + i + 1.
"""

from collections.abc import Iterator

import numpy as np

from np_drake.logs.sampled_flight import SampledFlight
from np_drake.residual_models.base import ForecastsWholeFlights, Memory, Plan, ReadsPlan, ResidualModel
from np_drake.rigid_body import P, V, W

KNOWN, HELD = "known", "held"  # coming motion
MOTIONS = (KNOWN, HELD)


def walk(model: ResidualModel, flight: SampledFlight) -> Iterator[tuple[int, Memory]]:
    """Yield every sample's number and the memory after it."""
    memory = model.initial_memory()
    for k in range(len(flight)):
        memory = model.update(memory, flight.sample(k))
        yield k, memory


def known_plan(flight: SampledFlight, k: int, steps: int) -> Plan:
    """Return the motion that was flown after sample k, over `steps` steps."""
    return Plan(flight.x[k : k + steps + 1], flight.u[k + 1 : k + steps + 1])


def held_plan(x: np.ndarray, u: np.ndarray, *, steps: int, step: float) -> Plan:
    """Return the motion x (13,) continued: velocity, attitude and command stay, and the body rates are zero.

    Own choice: a constant rate would turn the vehicle over within a second.   Args: u: (4,) [N, N·m].   step: [s].
    """
    course = np.tile(x, (steps + 1, 1))
    course[:, P] += step * np.arange(steps + 1)[:, None] * x[V]
    course[1:, W] = 0.0
    return Plan(course, np.tile(u, (steps, 1)))


def flight_forecasts(
    model: ResidualModel, flight: SampledFlight, horizons: list[int], *, first: int, motion: str
) -> np.ndarray:
    """Return the forecasts of labels 'horizons' steps ahead from sample `first` on, (n - first, H, 6) [N, N·m].

    NaN where the flight ends before.   Args: horizons: ascending, from 1 on [steps].   motion: `known`: the coming
    motion as flown; `held`: zeta stays, or for a model that reads a plan `held_plan`.
    """
    if motion not in MOTIONS:
        raise ValueError(f"flight_forecasts: motion must be {' | '.join(MOTIONS)}; got {motion}.")
    if not isinstance(model, ReadsPlan) and isinstance(model, ForecastsWholeFlights) and flight.gapless:
        at_once = _at_once(model, flight, horizons, first=first, motion=motion)
        if at_once is not None:
            return at_once
    chi_hat = np.full((len(flight) - first, len(horizons), 6), np.nan)
    for k, memory in walk(model, flight):
        steps = min(horizons[-1], len(flight) - 1 - k)
        if k < first or steps < horizons[0]:
            continue
        course, offset = _course(model, memory, flight, k, steps, motion)
        reached = [h for h in horizons if h <= steps]
        chi_hat[k - first, : len(reached)] = course[np.array(reached) - offset]
    return chi_hat


def _course(
    model: ResidualModel, memory: Memory, flight: SampledFlight, k: int, steps: int, motion: str
) -> tuple[np.ndarray, int]:
    """Return a forecast's chi_i, and how many samples ahead of i its label is (see the module)."""
    if isinstance(model, ReadsPlan):
        plan = (
            known_plan(flight, k, steps)
            if motion == KNOWN
            else held_plan(flight.x[k], flight.u[k], steps=steps, step=flight.step)
        )
        forecast = model.forecast_along(memory, plan, horizon=steps, stride=1)
        return forecast.rollout(plan.x[:-1, 7:13]), 1
    zeta = flight.zeta[k : k + steps + 1]
    zeta = zeta if motion == KNOWN else np.tile(zeta[0], (steps + 1, 1))
    return model.forecast(memory, horizon=steps + 1, stride=1).rollout(zeta), 0


def _at_once(
    model: ForecastsWholeFlights, flight: SampledFlight, horizons: list[int], *, first: int, motion: str
) -> np.ndarray | None:
    """Return the forecasts by the model's own shortcut for whole flights; None where it cannot."""
    course = model.along(flight.chi, flight.zeta)
    if course is None or course.first > first:
        return None
    chi_hat = np.full((len(flight) - first, len(horizons), 6), np.nan)
    for i, h in enumerate(horizons):
        origins = np.arange(first, len(flight) - h)
        if len(origins):
            chi_hat[: len(origins), i] = course.at([h], origins, flight.zeta, zeta_known=motion == KNOWN)[
                :, 0
            ]
    return chi_hat
