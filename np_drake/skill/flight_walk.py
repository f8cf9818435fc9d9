"""Forecasts of a residual model along a whole flight, fed sample by sample as in flight.

A model of the labels forecasts that of sample k + i as chi_i; a model that reads a plan forecasts
the mean wrench from t_(k+i) to t_(k+i+1) as chi_i. Where a label is the mean of the step that ends
at its sample, that is the one of sample k + i + 1; where it is of the instant, that is in the
middle of chi_i and chi_(i+1).
"""

from collections.abc import Iterator

import numpy as np

from np_drake.residual_model import ForecastsWholeFlights, Memory, Plan, ReadsPlan, ResidualModel
from np_drake.rigid_body import P, V, W
from np_drake.training_data.sampled_flight import SampledFlight

KNOWN, HELD = "known", "held"  # coming motion
MOTIONS = (KNOWN, HELD)


def walk(model: ResidualModel, flight: SampledFlight) -> Iterator[tuple[int, Memory]]:
    """Yield every sample's number and the memory after it."""
    memory = model.initial_memory()
    for k in range(len(flight)):
        memory = model.update(memory, flight.sample(k))
        yield k, memory


def held_plan(x: np.ndarray, u: np.ndarray, *, steps: int, step: float) -> Plan:
    """Return the motion x (13,) continued: velocity, attitude and command stay, and the body rates
    are zero.

    Own choice: a constant rate would turn the vehicle over within a second.

    Args:
        x: (13,) state now.
        u: (4,) command that goes on [N, N·m].
        steps: of the plan [1].
        step: [s].
    """
    course = np.tile(x, (steps + 1, 1))
    course[:, P] += step * np.arange(steps + 1)[:, None] * x[V]
    course[1:, W] = 0.0
    return Plan(course, np.tile(u, (steps, 1)))


def flight_forecasts(
    model: ResidualModel,
    flight: SampledFlight,
    horizons: list[int],
    *,
    first: int,
    motion: str,
    averaged: bool = True,
    at_once: bool = True,
) -> np.ndarray:
    """Return the forecasts of labels 'horizons' steps ahead from sample `first` on, (n - first, H,
    6) [N, N·m].

    NaN where the flight ends before.

    Args:
        horizons: ascending [steps]; from 1 on for a model that reads a plan.
        motion: `known`: the coming motion as flown; `held`: zeta stays, or for a model that reads a
            plan `held_plan`.
        averaged: whether the labels to be forecast are means of the step up to their sample, else
            of its instant.
    """
    if motion not in MOTIONS:
        raise ValueError(f"flight_forecasts: motion must be {' | '.join(MOTIONS)}; got {motion}.")
    reads_plan = isinstance(model, ReadsPlan)
    if at_once and not reads_plan and isinstance(model, ForecastsWholeFlights) and flight.gapless:
        found = _at_once(model, flight, horizons, first=first, motion=motion)
        if found is not None:
            return found
    if reads_plan and horizons[0] < 1:
        raise ValueError(
            f"flight_forecasts: horizons of {model.name} must be 1 or more; got {horizons[0]}."
        )
    chi_hat = np.full((len(flight) - first, len(horizons), 6), np.nan)
    for k, memory in walk(model, flight):
        steps = min(horizons[-1], len(flight) - 1 - k)
        if k < first or steps < horizons[0]:
            continue
        if isinstance(model, ReadsPlan):
            plan = _plan(flight, k, steps + (not averaged), motion)
            course = _labels_along(model, memory, plan, averaged=averaged)
        else:
            zeta = flight.zeta[k : k + steps + 1]
            zeta = zeta if motion == KNOWN else np.tile(zeta[0], (steps + 1, 1))
            course = model.forecast(memory, horizon=steps + 1, stride=1).rollout(zeta)
        reached = [h for h in horizons if h <= steps]
        chi_hat[k - first, : len(reached)] = course[reached]
    return chi_hat


def _plan(flight: SampledFlight, k: int, steps: int, motion: str) -> Plan:
    """Return the motion after sample k over `steps` steps, as flown until the flight ends, or
    held.
    """
    if motion == KNOWN:
        return Plan(flight.x[k : k + steps + 1], flight.u[k + 1 : k + steps + 1])
    return held_plan(flight.x[k], flight.u[k], steps=steps, step=flight.step)


def _labels_along(model: ReadsPlan, memory: Memory, plan: Plan, *, averaged: bool) -> np.ndarray:
    """Return the forecasts of the labels 0, 1, … ahead along a plan, (N + 1, 6); of label 0 there
    is none.
    """
    chi = model.forecast_along(memory, plan, horizon=len(plan.u), stride=1).rollout(
        plan.x[:-1, 7:13]
    )
    if not averaged:
        chi = 0.5 * (chi + np.vstack([chi[1:], chi[-1:]]))
    return np.vstack([np.full((1, 6), np.nan), chi])


def _at_once(
    model: ForecastsWholeFlights,
    flight: SampledFlight,
    horizons: list[int],
    *,
    first: int,
    motion: str,
) -> np.ndarray | None:
    """Return the forecasts by the model's own shortcut for whole flights; None where it cannot."""
    course = model.along(flight.chi, flight.zeta)
    if course is None or course.first > first:
        return None
    known, zeta, n = motion == KNOWN, flight.zeta, len(flight)
    chi_hat = np.full((n - first, len(horizons), 6), np.nan)
    whole = np.arange(first, n - horizons[-1])  # origins of which every target is there
    if len(whole):
        chi_hat[: len(whole)] = course.at(horizons, whole, zeta, zeta_known=known)
    for i, h in enumerate(horizons[:-1]):
        rest = np.arange(first + len(whole), n - h)
        if len(rest):
            chi_hat[rest - first, i] = course.at([h], rest, zeta, zeta_known=known)[:, 0]
    return chi_hat
