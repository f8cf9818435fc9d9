"""Collinearity: effects whose predicted residuals are the same in given flights."""

from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.diagnosis.forward_model import NEVER, StageCache, Term, predicted_residual
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Priors, Tolerance
from np_drake.diagnosis.regressors import (
    Candidate,
    Onset,
    at_value,
    calibration,
    library_candidates,
    payload_candidates,
    sensor_drift,
    wind_candidates,
)
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.effects.base import Effect
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay

DISTANCE = (
    14.0  # squared whitened distance below which noise hides the difference; own choice: about four sigma
)
LENGTHS = np.geomspace(0.2, 2.0, 12)  # tether lengths of payloads that are compared [m]


def collinear_effects(
    flights: Sequence[FlightResiduals],
    terms: Sequence[Term],
    i: int,
    noise: NoiseModel,
    tolerance: Tolerance,
    priors: Priors,
) -> list[str]:
    """Return the effects that are indistinguishable from terms[i] in these flights, nearest first.

    The term's contribution is the predicted residual with it less that without it. Another effect is indistinguishable
    if it comes within `DISTANCE` of the contribution. Its parameters are free, and mass, thrust and sensors are free
    within tolerance.

    Args:
        flights: the flights.
        terms: all terms of the model.
        i: position of the term to compare.
        noise: noise model that whitens.
        tolerance: tolerance of mass, thrust and sensors.
    """
    trace = _contribution(flights, terms, i)
    onset: Onset = {n: t for n, t in terms[i].onset.items() if t is not None and t != NEVER}
    options = [*_options(flights, priors, onset), *_mirror_images(flights, terms[i], onset)]
    known = {t.effect.identifier for t in terms}
    options = [option for option in options if option.identifiers[-1] not in known]
    return _same(flights, trace, options, noise, tolerance)


def is_calibration(
    flights: Sequence[FlightResiduals],
    terms: Sequence[Term],
    i: int,
    noise: NoiseModel,
    tolerance: Tolerance,
) -> bool:
    """Return whether what vehicle file and input may be off by is the same as terms[i] in these flights.

    Args: as `collinear_effects`.
    Returns: False where noise alone hides the term.
    """
    return is_calibration_trace(flights, _contribution(flights, terms, i), noise, tolerance)


def is_calibration_trace(
    flights: Sequence[FlightResiduals],
    trace: Mapping[str, np.ndarray],
    noise: NoiseModel,
    tolerance: Tolerance,
    within: float = DISTANCE,
) -> bool:
    """Return `is_calibration` of a residual. Args: as `effects_of_trace`."""
    distance = _Distance(flights, trace, noise, tolerance, sensors=False)
    return distance.to([]) < within <= distance.power


def effects_of_trace(
    flights: Sequence[FlightResiduals],
    trace: Mapping[str, np.ndarray],
    noise: NoiseModel,
    tolerance: Tolerance,
    priors: Priors,
    within: float = DISTANCE,
) -> list[str]:
    """Return the library effects within a squared whitened distance of a residual in these flights, nearest first.

    Args:
        flights: the flights.
        trace: by flight, (m, 15) residual in the channels of `FlightResiduals`.
        noise: noise model that whitens.
        tolerance: tolerance of mass, thrust and sensors.
        within: largest squared whitened distance.
    Returns: identifiers; empty where mass, thrust and sensors within tolerance come as near by themselves.
    """
    if _Distance(flights, trace, noise, tolerance).to([]) < within:
        return []
    return _same(flights, trace, _options(flights, priors, {}), noise, tolerance, within)


def _contribution(flights: Sequence[FlightResiduals], terms: Sequence[Term], i: int) -> dict[str, np.ndarray]:
    """Return by flight what the predicted residual with terms[i] has over that without it, (m, 15)."""
    rest = [t for j, t in enumerate(terms) if j != i]
    return {e.name: predicted_residual(e, terms) - predicted_residual(e, rest) for e in flights}


def _same(
    flights: Sequence[FlightResiduals],
    trace: Mapping[str, np.ndarray],
    options: Sequence[Candidate],
    noise: NoiseModel,
    tolerance: Tolerance,
    within: float = DISTANCE,
) -> list[str]:
    distance = _Distance(flights, trace, noise, tolerance)
    found: dict[str, float] = {}
    for option in options:
        name = option.identifiers[-1]
        found[name] = min(distance.to([option]), found.get(name, np.inf))
    return sorted((n for n, d in found.items() if d < within), key=lambda n: found[n])


def _options(flights: Sequence[FlightResiduals], priors: Priors, onset: Onset) -> list[Candidate]:
    plain = library_candidates(flights, onset or None)
    return [
        *plain,
        *wind_candidates(flights, plain, onset),
        *payload_candidates(flights, LENGTHS, priors, onset),
    ]


def _mirror_images(flights: Sequence[FlightResiduals], term: Term, onset: dict) -> list[Candidate]:
    """Return a delay and a clock offset of the size of the given shift, because they are not linear in it."""
    if not term.effect.pure_delay:
        return []
    delay = term.effect.time_shift(flights[0].vehicle)
    twins: list[tuple[type[Effect], dict[str, float]]] = [(ClockOffset, {"offset": -delay})]
    twins += [(CommandDelay, {"delay": delay})] if delay > 0 else []
    stages = {e.name: StageCache() for e in flights}
    return [
        at_value(effect, flights, onset, values, 1, stages)
        for effect, values in twins
        if not onset or effect.begins
    ]


class _Distance:
    """Squared whitened distance of a residual from the span of candidates and tolerated calibration errors."""

    def __init__(
        self,
        flights: Sequence[FlightResiduals],
        trace: Mapping[str, np.ndarray],
        noise: NoiseModel,
        tolerance: Tolerance,
        *,
        sensors: bool = True,
    ) -> None:
        """Whiten all. sensors: whether their errors are tolerated too."""
        self._flights, self._noise = flights, noise
        self._target = np.concatenate([noise.whiten(trace[e.name]).ravel() for e in flights])
        drifting = sensor_drift(flights, tolerance) if sensors else None
        self._fixed = self._columns([*calibration(flights, tolerance), *([drifting] if drifting else [])])

    @property
    def power(self) -> float:
        """Return the squared whitened size of the residual [1]."""
        return float(self._target @ self._target)

    def to(self, candidates: Sequence[Candidate]) -> float:
        """Return min |target - X c|² + |c|² over c, the prior's penalty included."""
        X = np.hstack([self._fixed, self._columns(candidates)]) if candidates else self._fixed
        b = X.T @ self._target
        return float(self.power - b @ np.linalg.solve(X.T @ X + np.eye(X.shape[1]), b))

    def _columns(self, candidates: Sequence[Candidate]) -> np.ndarray:
        parts = []
        for e in self._flights:
            X = self._noise.whiten(np.concatenate([c.columns[e.name] for c in candidates], axis=-1))
            parts.append(X.reshape(-1, X.shape[-1]))
        return np.concatenate(parts)
