"""Multi-step prediction error of residual models on one flight, beside naive predictors."""

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from np_drake.residual_model import ForecastsWholeFlights, Memory, Plan, ReadsPlan, ResidualModel
from np_drake.rigid_body import P, V, W
from np_drake.training_data.training_segments import SampledFlight, of_wrenches

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
    if not reads_plan and isinstance(model, ForecastsWholeFlights) and flight.gapless:
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


NAIVE = ("persistence", "linear", "mean")  # whose best is what skill is measured by
UNTRAINED = (*NAIVE, "past mean")  # rows of every table


def skill_table(
    models: dict[str, ResidualModel],
    chi: np.ndarray,
    zeta: np.ndarray,
    *,
    horizons: list[int],
    mean: np.ndarray,
    target: np.ndarray | None = None,
    zeta_known: bool = True,
    warm_up: int = 40,
    flight: str = "flight",
    seen: Mapping[str, SampledFlight] = MappingProxyType({}),
) -> list[dict[str, Any]]:
    """Return the rows of all models and naive predictors, horizon by horizon.

    flight, model, horizon [steps], and of force and torque each (`force_rmse` …):

    rmse: of the norm over all origins [N, N·m].
    skill: RMSE over that of the best naive row at that horizon [1].
    ratio: over that of persistence [1]; interval: 95 % of the ratio within this flight (see
        `ratio_interval`), NaN where the flight is too short for one.
    peak: longest forecast of the flight over its longest label [1]; a forecast that diverges has a
        large one.

    Args:
        chi: (n, 6) labels as the models see them [N, N·m].
        zeta: (n, 6) [m/s, rad/s].
        horizons: steps ahead: origin k predicts sample k + horizon.
        mean: (6,) of chi in training [N, N·m].
        target: (n, 6) wrench that forecasts are compared with [N, N·m]; None for chi.
        zeta_known: feed the true coming zeta, else hold the last one.
        seen: by the name of a model that needs more than chi and zeta: the flight as it sees it, at
            the same samples.
    Raises: ValueError: if the flight is too short for one origin.
    """
    horizons = sorted(set(horizons))
    origins = np.arange(warm_up, len(chi) - horizons[-1])
    if len(origins) == 0 or horizons[0] < 0:
        raise ValueError(
            f"skill_table: {flight}: more than {warm_up + horizons[-1]} samples are "
            f"needed; got {len(chi)}."
        )
    goal = (chi if target is None else target)[origins[:, None] + horizons]
    predictions = naive_predictions(chi, origins, horizons, mean)
    for name, model in models.items():
        predictions[name] = model_predictions(
            model, chi, zeta, origins, horizons, zeta_known=zeta_known, seen=seen.get(name)
        )
    square = {name: _size(prediction - goal) ** 2 for name, prediction in predictions.items()}
    rmse = {name: np.sqrt(error.mean(axis=0)) for name, error in square.items()}
    longest = _size(chi).max(axis=0)
    peaks = {
        name: _ratio(_size(chi_hat).max(axis=0), longest) for name, chi_hat in predictions.items()
    }
    best = np.min([rmse[name] for name in NAIVE], axis=0)
    interval = {
        name: ratio_interval(error, square["persistence"], horizons)
        for name, error in square.items()
    }
    rows = []
    for name, error in rmse.items():
        skill, ratio = _ratio(error, best), _ratio(error, rmse["persistence"])
        for i, horizon in enumerate(horizons):
            figures = {
                f"{kind}_{what}": float(values[i, k])
                for what, values in (
                    ("rmse", error),
                    ("skill", skill),
                    ("ratio", ratio),
                    ("peak", peaks[name]),
                )
                for k, kind in enumerate(("force", "torque"))
            }
            force, torque = (tuple(map(float, bounds)) for bounds in interval[name][i])
            named = {"flight": flight, "model": name, "horizon": horizon}
            rows.append({**named, **figures, "force_interval": force, "torque_interval": torque})
    return rows


def _ratio(error: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return the ratio, NaN where the reference is zero (persistence of the sample itself, a label
    of zero).
    """
    return np.divide(error, reference, out=np.full_like(error, np.nan), where=reference > 0)


def _size(chi: np.ndarray) -> np.ndarray:
    """Return the length of force [N] and torque [N·m], (..., 2)."""
    return np.stack(
        [np.linalg.norm(chi[..., :3], axis=-1), np.linalg.norm(chi[..., 3:], axis=-1)], axis=-1
    )


def naive_predictions(
    chi: np.ndarray, origins: np.ndarray, horizons: list[int], mean: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the forecasts of the naive predictors by name, (o, len(horizons), 6) each [N, N·m].

    They are persistence, linear extrapolation of the last two samples, the training mean, and the
    mean of the flight up to now.

    Args:
        chi: (n, 6) labels [N, N·m].
        origins: (o,) sample indices.
        horizons: [steps].
        mean: (6,) of the training.
    """
    last = chi[origins][:, None]
    slope = last - chi[origins - 1][:, None]
    steps = np.array(horizons, float)[:, None]
    so_far = np.cumsum(chi, axis=0)[origins] / (origins + 1.0)[:, None]
    shape = (len(origins), len(horizons), 6)
    return {
        "persistence": np.broadcast_to(last, shape),
        "linear": last + steps * slope,
        "mean": np.broadcast_to(mean, shape),
        "past mean": np.broadcast_to(so_far[:, None], shape),
    }


def model_predictions(
    model: ResidualModel,
    chi: np.ndarray,
    zeta: np.ndarray,
    origins: np.ndarray,
    horizons: list[int],
    *,
    zeta_known: bool,
    seen: SampledFlight | None = None,
) -> np.ndarray:
    """Return chi_hat (o, len(horizons), 6) [N, N·m] of a model that walks along a flight, see
    `flight_walk`.

    Args:
        chi: (n, 6) labels [N, N·m].
        zeta: (n, 6) [m/s, rad/s].
        origins: (o,) sample indices.
        horizons: [steps].
        zeta_known: use the true coming motion, else hold the last one.
        seen: the flight as the model sees it, where it needs more than chi and zeta.
    """
    flight = of_wrenches(chi, zeta, model.step) if seen is None else seen
    chi_hat = flight_forecasts(
        model,
        flight,
        horizons,
        first=int(origins[0]),
        motion=KNOWN if zeta_known else HELD,
        averaged=False,
    )
    return chi_hat[origins - origins[0]]


BLOCKS = 20  # a flight is cut into at most so many [1]
FEWEST = 5  # and into no fewer, else nothing is said [1]
DRAWS = 400  # of the blocks [1]
LEVEL = 0.95  # probability of an interval [1]


def ratio_interval(square: np.ndarray, reference: np.ndarray, horizons: list[int]) -> np.ndarray:
    """Return low and high of RMSE over the reference's RMSE, (H, 2, 2) [1], by paired block
    bootstrap over one flight.

    Args:
        square: (o, H, 2) squared errors at successive origins.
        reference: (o, H, 2) those of the reference.
        horizons: lower limits of the block lengths, one a horizon [steps].
    """
    out = np.full((*square.shape[1:], 2), np.nan)
    tails = 50 * (1 - LEVEL), 50 * (1 + LEVEL)
    for i, horizon in enumerate(horizons):
        count = min(BLOCKS, len(square) // max(horizon, 1))
        if count < FEWEST:
            continue
        edges = np.linspace(0, len(square), count + 1).astype(int)[:-1]
        # Block bootstrap: how often each block is drawn, with replacement; sums over blocks give
        # the drawn RMSE
        drawn = np.random.default_rng(0).multinomial(count, np.full(count, 1.0 / count), DRAWS)
        over, under = (drawn @ np.add.reduceat(x[:, i], edges, axis=0) for x in (square, reference))
        if np.all(under > 0):
            out[i] = np.percentile(np.sqrt(over / under), tails, axis=0).T
    return out
