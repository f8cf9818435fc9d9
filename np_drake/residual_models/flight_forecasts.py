"""Forecasts of a residual model along a flight, sample by sample, as it is fed in flight."""

from collections.abc import Iterator

import numpy as np

from np_drake.checks import require
from np_drake.residual_model import Memory, Plan, ReadsPlan, ResidualModel
from np_drake.rigid_body import P, V, W
from np_drake.training_data.segments import SampledFlight

KNOWN = "known"  # the coming motion as flown
CONSTANT = "held"  # the motion of now, held
MOTIONS = (KNOWN, CONSTANT)


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
    require(
        motion in MOTIONS, f"flight_forecasts: motion must be {' | '.join(MOTIONS)}; got {motion}."
    )
    require(
        not isinstance(model, ReadsPlan) or horizons[0] >= 1,
        f"flight_forecasts: horizons of {model.name} must be 1 or more; got {horizons[0]}.",
    )
    chi_hat = np.full((len(flight) - first, len(horizons), 6), np.nan)
    for k, memory in walk(model, flight):
        steps = min(horizons[-1], len(flight) - 1 - k)
        if k < first or steps < horizons[0]:
            continue
        if isinstance(model, ReadsPlan):
            last = k + steps + (not averaged)
            plan = (
                Plan(flight.x[k : last + 1], flight.u[k + 1 : last + 1])
                if motion == KNOWN
                else held_plan(flight.x[k], flight.u[k], steps=last - k, step=flight.step)
            )
            course = _labels_along(model, memory, plan, averaged=averaged)
        else:
            zeta = flight.zeta[k : k + steps + 1]
            zeta = zeta if motion == KNOWN else np.tile(zeta[0], (steps + 1, 1))
            course = model.forecast(memory, horizon=steps + 1, stride=1).rollout(zeta)
        reached = [h for h in horizons if h <= steps]
        chi_hat[k - first, : len(reached)] = course[reached]
    return chi_hat


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
