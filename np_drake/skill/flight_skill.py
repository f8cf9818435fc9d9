"""Skill and stability of trained predictors on whole flights, as rows of numbers."""

import dataclasses as dc
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.lifting.model.lifted_model import FAMILIES, MODE_DICTIONARY, PAPER, LiftedModel
from np_drake.lifting.model.model_file import origin_of, require_origin
from np_drake.logs.formats.neurobem import TESTS
from np_drake.payload_filter.model_file import PAYLOAD_FILTER, PayloadFilterModel
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.residual_model import FlightForecasts, ResidualModel
from np_drake.residual_models.neural_predictor import NeuralPredictor, RefitForecasts
from np_drake.skill.skill import UNTRAINED, skill_table, walk
from np_drake.training_data.segments import Segment, WrenchSequence
from np_drake.training_data.training_segments import Flight, SampledFlight, flown_segments

ROUNDING = 1e-9  # of a spectral radius [1]
CHUNK = 4000  # windows at a time, for memory [1]


@dc.dataclass(frozen=True)
class WindowStability:
    """Counts of unstable windows of one flight.

    pulled: windows whose least-squares A lay outside and was made stable before use (0 without a
    refit).
    """

    windows: int  # of the flight
    unstable: int  # of these, with a spectral radius of A above 1
    largest: float  # of all radii [1]
    pulled: int


def walked_stability(model: ResidualModel, flight: SampledFlight) -> WindowStability:
    """Return the counts over every sample of a flight, of a model that makes its A anew at each.

    A pendulum without damping lies on the unit circle, so that rounding does not count.
    """
    forecasts = [model.forecast(memory, horizon=1, stride=1) for _, memory in walk(model, flight)]
    radius = np.abs(np.linalg.eigvals(np.stack([forecast.A for forecast in forecasts]))).max(axis=1)
    return WindowStability(
        len(radius), int(np.sum(radius > 1.0 + ROUNDING)), float(radius.max()), 0
    )


def stability_of(course: FlightForecasts) -> WindowStability:
    """Return the counts over given forecasts."""
    windows = len(course.z)
    if not isinstance(course, RefitForecasts):
        radius = np.full(windows, np.abs(np.linalg.eigvals(course.A)).max(initial=0.0))
        return WindowStability(windows, int(np.sum(radius > 1.0)), float(radius[0]), 0)
    pieces = [course.A[i : i + CHUNK] for i in range(0, len(course.A), CHUNK)]
    radius = np.concatenate([np.abs(np.linalg.eigvals(A)).max(axis=1) for A in pieces])
    pulled = int(np.sum(course.before > radius + 1e-12))
    return WindowStability(len(radius), int(np.sum(radius > 1.0)), float(radius.max()), pulled)


OURS = (PAPER, *FAMILIES, MODE_DICTIONARY, PAYLOAD_FILTER)
WARM_UP = 40  # samples before the first origin, at least [1]
Model = LiftedModel | PayloadFilterModel
DIVERGED = 10.0  # longest forecast over longest label from which a flight counts as diverged [1]
STEP_TOLERANCE = 0.02  # between a model's step and an array's [1]


def score_flights(
    models: Mapping[str, Model],
    flights: Sequence[Flight],
    horizons: list[int],
    *,
    zeta: str,
    baselines: Mapping[str, ResidualModel] = MappingProxyType({}),
    mean: np.ndarray | None = None,
    on_model: Callable[[int, int], None] = lambda *_: None,
) -> list[dict[str, Any]]:
    """Return a row for every model, baseline and naive predictor on every flight, horizon in
    seconds.

    Args:
        horizons: [steps].
        zeta: `held` at its last value, or `known`.
        mean: (6,) of chi in training; None: the flight's own, which no predictor could know.
        on_model: called with (done, total) after every model.
    Raises: ValueError: if a step is not the model's, or a flight too short.
    """
    rows: list[dict[str, Any]] = []
    for number, flight in enumerate(flights):
        name = flight_name(flight)
        for place, (label, model) in enumerate(models.items()):
            predictor = _predictor(model)
            segment, seen = _longest_flown(flight, predictor)
            table = skill_table(
                {label: predictor, **(baselines if place == 0 else {})},
                segment.chi,
                segment.zeta,
                horizons=horizons,
                mean=segment.chi.mean(axis=0) if mean is None else mean,
                target=segment.goal,
                zeta_known=zeta == "known",
                warm_up=WARM_UP
                if isinstance(model, PayloadFilterModel)
                else max(WARM_UP, model.warm_up),
                flight=name,
                seen={} if seen is None else {label: seen},
            )
            rows += [
                {**row, "horizon": row["horizon"] * segment.step, "zeta": zeta}
                for row in table
                if place == 0 or row["model"] not in UNTRAINED
            ]
            on_model(number * len(models) + place + 1, len(flights) * len(models))
    return rows


def flight_name(flight: Flight) -> str:
    """Return the paper's name of a flight where it has one."""
    return TESTS.get(f"merged_{flight.data.name}", flight.data.name)


def _predictor(model: Model) -> NeuralPredictor | PayloadFilter:
    """Return the predictor of a model; torque is predicted where it was trained."""
    if isinstance(model, PayloadFilterModel):
        return PayloadFilter(model)
    return NeuralPredictor(model, torque="predict" if model.predicts_torque else "hold")


def _longest_flown(
    flight: Flight, predictor: NeuralPredictor | PayloadFilter
) -> tuple[Segment, SampledFlight | None]:
    """Return the longest uninterrupted piece of a flight, and for a model that reads a plan that
    piece as it sees it.

    Raises: ValueError: if the predictor was trained on other labels, or nothing usable is left.
    """
    if not isinstance(predictor, PayloadFilter):
        require_origin(predictor.model, {"frame": flight.frame})
        return _longest_piece(flight, predictor.step), None
    require_origin(predictor.model, origin_of(flight.frame, flight.vehicle, predictor.label))
    if not isinstance(flight.data, FlightLog):
        raise ValueError(
            f"{flight.data.name}: must be a flight log, with attitude and command, for "
            f"{PAYLOAD_FILTER}; got an array."
        )
    pieces = flown_segments(flight.data, flight.vehicle, predictor, step=predictor.step)
    if not pieces:
        raise ValueError(f"{flight.data.name}: must hold rows without NaN; got none.")
    return max(pieces, key=lambda piece: len(piece[0]))


def label_distances(models: Mapping[str, Model], flights: Sequence[Flight]) -> list[dict[str, Any]]:
    """Return how far labels without low-pass lie from the targets, force [N] and torque [N·m], RMS
    by flight.

    What a low-pass takes from the target counts as the error of labels that have one.

    Args:
        models: by name; those that forecast labels without low-pass count.
        flights: as of `score_flights`.
    """
    lines = []
    for flight in flights:
        for label, model in models.items():
            if not isinstance(model, PayloadFilterModel):
                continue
            unlagged = PayloadFilter(dc.replace(model, rotor_lag=0.0))
            segment, seen = _longest_flown(flight, unlagged)
            square = np.nanmean((seen.chi - segment.goal) ** 2, axis=0) if seen else np.zeros(6)
            force, torque = np.sqrt([square[:3].sum(), square[3:].sum()]).tolist()
            lines.append(
                {"flight": flight_name(flight), "model": label, "force": force, "torque": torque}
            )
    return lines


def _longest_piece(flight: Flight, step: float) -> Segment:
    """Return the longest uninterrupted piece of a flight, at a model's step [s].

    Raises: ValueError: if an array has another step, or nothing usable is left.
    """
    data = flight.data
    if isinstance(data, WrenchSequence) and abs(data.step - step) > STEP_TOLERANCE * step:
        raise ValueError(
            f"{data.name}: step must be the model's, {step:g} s; got {data.step:g} s. "
            f"Train on such arrays."
        )
    pieces = flight.segments(step)
    if not pieces:
        raise ValueError(f"{data.name}: must hold rows without NaN; got none.")
    return max(pieces, key=len)


def diverged(rows: list[dict[str, Any]]) -> list[str]:
    """Return the flights on which a model's RMSE is no number, or a forecast is `DIVERGED` times
    the longest label.

    A baseline may diverge; nothing keeps it from that.
    """
    return sorted({row["flight"] for row in rows if row["model"] in OURS and not _bounded(row)})


def _bounded(row: dict[str, Any]) -> bool:
    peaks = [row[f"{kind}_peak"] for kind in ("force", "torque")]
    finite = np.isfinite(row["force_rmse"]) and np.isfinite(row["torque_rmse"])
    return bool(finite and not any(peak > DIVERGED for peak in peaks))


def flight_stability(
    models: Mapping[str, Model], flights: Sequence[Flight]
) -> list[dict[str, Any]]:
    """Return the spectral radius of A in every window of every flight, model by model; see
    `WindowStability`.

    Args:
        flights: as of `score_flights`.
    Raises: ValueError: as `score_flights`.
    """
    lines = []
    for flight in flights:
        for label, model in models.items():
            predictor = _predictor(model)
            segment, seen = _longest_flown(flight, predictor)
            if isinstance(predictor, NeuralPredictor):
                course = predictor.along(segment.chi, segment.zeta)
                if course is None:
                    raise ValueError(
                        f"stability: at least {predictor.model.warm_up} samples are needed; "
                        f"got {len(segment)}."
                    )
                found = stability_of(course)
            elif seen is not None:
                found = walked_stability(predictor, seen)
            lines.append({"flight": flight_name(flight), "model": label, **dc.asdict(found)})
    return lines
