"""Stability of the operators in flight: the spectral radius of A in every window."""

import dataclasses as dc

import numpy as np

from np_drake.residual_model import FlightForecasts, ResidualModel
from np_drake.residual_models.neural_predictor import NeuralPredictor, RefitForecasts
from np_drake.skill.flight_walk import walk
from np_drake.training_data.sampled_flight import SampledFlight

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


def window_stability(model: NeuralPredictor, chi: np.ndarray, zeta: np.ndarray) -> WindowStability:
    """Return the counts over every forecast along a flight without gaps.

    Args:
        chi: (n, 6) [N, N·m].
        zeta: (n, 6) [m/s, rad/s].
    Raises: ValueError: if the flight ends before the first forecast.
    """
    course = model.along(chi, zeta)
    if course is None:
        raise ValueError(
            f"stability: at least {model.model.warm_up} samples are needed; got {len(chi)}."
        )
    return stability_of(course)


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
