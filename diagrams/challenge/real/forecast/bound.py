"""The bound on forecasts whose matrices change from solve to solve, checked on flights."""

import dataclasses as dc
from typing import Any

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.lifting.bounds.forecast_bound import forecast_bound
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.residual_model import ReadsPlan
from np_drake.skill.flight_walk import held_plan, walk
from np_drake.training_data.sampled_flight import SampledFlight, sampled_flight
from np_drake.vehicle import Vehicle

SHARE = 1e-9  # by which round-off may exceed the bound [1]
STILL = 1e-9  # deviation of a channel that does not move [N, N·m, m/s, rad/s]


@dc.dataclass(frozen=True)
class BoundCheck:
    """Bound and error of every forecast of a flight, in units of the flight's own labels.

    bound, error: (o, H) by origin and horizon [1].
    """

    flight: str
    bound: np.ndarray
    error: np.ndarray

    @property
    def held(self) -> np.ndarray:
        """Whether the bound holds, (o,), at every horizon."""
        return np.all(self.error <= self.bound * (1 + SHARE) + SHARE, axis=1)


def check_bound(
    model: Any, opened: tuple[FlightLog, Vehicle], horizons: list[int], *, first: int
) -> BoundCheck | None:
    """Return bound and error of the forecasts of a pendulum on a flight; None of another model.

    The plan holds velocity and attitude; the error is that of the linear forecast under the motion as flown. The
    largest changes are the flight's own, as in the check of the fixed matrices.
    Args: horizons: ascending [steps].   first: sample from which on forecasts count [1].
    """
    if not isinstance(model, PayloadFilter):
        return None
    flight = sampled_flight(*opened, step=model.step, label=model.label)
    steps = horizons[-1]
    chi_scale, zeta_scale = _scale(flight.chi, still=np.inf), _scale(flight.zeta, still=1.0)
    moved = [
        _largest_changes(values / scale, steps)
        for values, scale in ((flight.chi, chi_scale), (flight.zeta, zeta_scale))
    ]
    bounds, errors = [], []
    for k, memory in walk(model, flight):
        coming = slice(k + 1, k + 1 + steps)
        if k < first or k + steps >= len(flight) or not np.isfinite(flight.chi[k : k + 1 + steps]).all():
            continue
        forecast = _forecast(model, memory, flight, k, steps)
        bound = forecast_bound(
            forecast,
            flight.chi[k],
            flight.zeta[k],
            moved[0][1:],  # label 1 … steps ahead
            moved[1][:-1],
            chi_scale=chi_scale,
            zeta_scale=zeta_scale,
        )
        flown = forecast.rollout(flight.zeta[k : k + steps])
        error = np.linalg.norm((flight.chi[coming] - flown) / chi_scale, axis=1)
        at = np.array(horizons) - 1
        bounds.append(bound[at])
        errors.append(error[at])
    shape = (-1, len(horizons))
    return BoundCheck(flight.name, np.reshape(bounds, shape), np.reshape(errors, shape))


def _forecast(model: ReadsPlan, memory: Any, flight: SampledFlight, k: int, steps: int) -> Any:
    plan = held_plan(flight.x[k], flight.u[k], steps=steps, step=flight.step)
    return model.forecast_along(memory, plan, horizon=steps, stride=1)


def _scale(values: np.ndarray, *, still: float) -> np.ndarray:
    """Return the standard deviation of every channel, `still` where it does not move: then it does not count."""
    deviation = np.nanstd(values, axis=0)
    return np.where(deviation > STILL, deviation, still)


def _largest_changes(values: np.ndarray, steps: int) -> np.ndarray:
    """Return the largest length of a change over 0 … `steps` samples in a flight, (steps + 1,)."""
    found = [0.0]
    for n in range(1, steps + 1):
        change = np.linalg.norm(values[n:] - values[:-n], axis=1)
        found.append(max(found[-1], float(np.nanmax(change, initial=0.0))))
    return np.array(found)


def bound_lines(checks: list[BoundCheck], horizons: list[int], step: float) -> list[dict[str, Any]]:
    """Return by horizon how many forecasts the bound holds for, and its ratio to the error."""
    bound, error = (np.concatenate([getattr(c, name) for c in checks]) for name in ("bound", "error"))
    ratio = bound / np.maximum(error, 1e-12)
    return [
        {
            "horizon": h * step,
            "forecasts": len(bound),
            "held": int(np.sum(error[:, i] <= bound[:, i] * (1 + SHARE) + SHARE)),
            "median": float(np.median(ratio[:, i])),
            "quantile": float(np.percentile(ratio[:, i], 95)),
        }
        for i, h in enumerate(horizons)
    ]
