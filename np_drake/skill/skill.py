"""Multi-step prediction error of residual models on one flight, beside naive predictors."""

import dataclasses as dc
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.flight_log import FlightLog
from np_drake.lifting.model.lifted_model import LiftedModel
from np_drake.lifting.model.lpv_model import LpvModel
from np_drake.logs.formats.neurobem import TESTS
from np_drake.payload_filter.model_file import PayloadFilterModel
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.residual_model import ResidualModel
from np_drake.residual_models.flight_forecasts import KNOWN, flight_forecasts
from np_drake.residual_models.lifted_predictor import LiftedLinearPredictor
from np_drake.trained_model import origin_of, require_origin
from np_drake.training_data.segments import (
    Flight,
    SampledFlight,
    Segment,
    flown_segments,
    of_wrenches,
)

NAIVE = ("persistence", "linear", "mean")  # whose best is what skill is measured by
UNTRAINED = (*NAIVE, "past mean")  # rows of every table


def skill_table(
    models: dict[str, ResidualModel],
    segment: Segment,
    *,
    horizons: list[int],
    mean: np.ndarray,
    motion: str = KNOWN,
    warm_up: int = 40,
    seen: Mapping[str, SampledFlight] = MappingProxyType({}),
) -> list[dict[str, Any]]:
    """Return the rows of all models and naive predictors, horizon by horizon.

    flight (the segment's name), model, horizon [steps], and of force and torque each
    (`force_rmse` …):

    rmse: of the norm over all origins [N, N·m].
    skill: RMSE over that of the best naive row at that horizon [1].
    ratio: over that of persistence [1].
    peak: longest forecast of the flight over its longest label [1]; a forecast that diverges has a
        large one.

    Args:
        segment: of the flight; forecasts are compared with its goal.
        horizons: steps ahead: origin k predicts sample k + horizon.
        mean: (6,) of chi in training [N, N·m].
        motion: `known` | `held`, as of `flight_forecasts`.
        seen: by the name of a model that needs more than chi and zeta: the flight as it sees it, at
            the same samples.
    Raises: ValueError: if the flight is too short for one origin.
    """
    chi = segment.chi
    horizons = sorted(set(horizons))
    origins = np.arange(warm_up, len(chi) - horizons[-1])
    require(
        len(origins) != 0 and horizons[0] >= 0,
        f"skill_table: {segment.name}: more than {warm_up + horizons[-1]} samples are "
        f"needed; got {len(chi)}. Give a longer flight without gaps, or nearer horizons.",
    )
    goal = segment.goal[origins[:, None] + horizons]
    predictions = naive_predictions(chi, origins, horizons, mean)
    for name, model in models.items():
        sampled = seen.get(name, of_wrenches(chi, segment.zeta, model.step))
        chi_hat = flight_forecasts(
            model, sampled, horizons, first=warm_up, motion=motion, averaged=False
        )
        predictions[name] = chi_hat[: len(origins)]
    rmse = {
        name: np.sqrt((_size(prediction - goal) ** 2).mean(axis=0))
        for name, prediction in predictions.items()
    }
    longest = _size(chi).max(axis=0)
    peaks = {
        name: _ratio(_size(chi_hat).max(axis=0), longest) for name, chi_hat in predictions.items()
    }
    best = np.min([rmse[name] for name in NAIVE], axis=0)
    rows = []
    for name, error in rmse.items():
        skill = _ratio(error, best)
        ratio = _ratio(error, rmse["persistence"])
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
            rows.append({"flight": segment.name, "model": name, "horizon": horizon, **figures})
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


WARM_UP = 40  # samples before the first origin, at least [1]
Model = LiftedModel | LpvModel | PayloadFilterModel
Predictor = LiftedLinearPredictor | PayloadFilter
DIVERGED = 10.0  # longest forecast over longest label from which a flight counts as diverged [1]
STEP_TOLERANCE = 0.02  # between a model's step and an array's [1]


def score_flights(
    model: Model,
    flights: Sequence[Flight],
    horizons: list[int],
    *,
    zeta: str,
    on_flight: Callable[[int, int], None] = lambda *_: None,
) -> list[dict[str, Any]]:
    """Return a row for the model and every naive predictor on every flight, horizon in seconds; the
    mean is the flight's own, which no predictor could know.

    Args:
        horizons: [steps].
        zeta: `held` at its last value, or `known`.
        on_flight: called with (done, total) after every flight.
    Raises: ValueError: if a step is not the model's, or a flight too short.
    """
    rows: list[dict[str, Any]] = []
    name = model.configuration
    predictor: Predictor = (
        PayloadFilter(model)
        if isinstance(model, PayloadFilterModel)
        else LiftedLinearPredictor.of(model)
    )
    for number, flight in enumerate(flights, 1):
        segment, seen = _longest_flown(flight, predictor)
        paper_name = TESTS.get(f"merged_{flight.data.name}", flight.data.name)
        table = skill_table(
            {name: predictor},
            dc.replace(segment, name=paper_name),
            horizons=horizons,
            mean=segment.chi.mean(axis=0),
            motion=zeta,
            warm_up=max(WARM_UP, model.window if isinstance(model, LiftedModel) else 1),
            seen={name: seen},
        )
        rows += [{**row, "horizon": row["horizon"] * segment.step, "zeta": zeta} for row in table]
        on_flight(number, len(flights))
    return rows


def _longest_flown(flight: Flight, predictor: Predictor) -> tuple[Segment, SampledFlight]:
    """Return the longest uninterrupted piece of a flight, and that piece as the predictor sees it.

    Raises: ValueError: if the predictor was trained on other labels, an array has another step, or
        nothing usable is left.
    """
    require_origin(predictor.model, origin_of(flight.frame, flight.vehicle, predictor.label))
    data = flight.data
    step = predictor.step
    if isinstance(data, FlightLog):
        pieces = flown_segments(data, flight.vehicle, predictor, step=step)
    else:
        require(
            isinstance(predictor, LiftedLinearPredictor),
            f"{data.name}: must be a flight log, with attitude and command, for "
            f"{predictor.name}; got an array.",
        )
        require(
            abs(data.step - step) <= STEP_TOLERANCE * step,
            f"{data.name}: step must be the model's, {step:g} s; got {data.step:g} s. "
            f"Train on such arrays.",
        )
        pieces = [(s, of_wrenches(s.chi, s.zeta, s.step)) for s in flight.segments(step)]
    require(pieces, f"{data.name}: must hold rows without NaN; got none.")
    return max(pieces, key=lambda piece: len(piece[0]))


def diverged(rows: list[dict[str, Any]]) -> list[str]:
    """Return the flights on which a model's RMSE is no number, or a forecast is `DIVERGED` times
    the longest label; nothing keeps a naive one from that.
    """
    lost = {
        row["flight"]
        for row in rows
        if row["model"] not in UNTRAINED
        and any(
            not np.isfinite(row[f"{kind}_rmse"]) or row[f"{kind}_peak"] > DIVERGED
            for kind in ("force", "torque")
        )
    }
    return sorted(lost)
