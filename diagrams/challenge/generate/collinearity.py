"""Collinearity: effects whose predicted residuals are the same in given flights."""

from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.diagnosis.calibration import flight_errors
from np_drake.diagnosis.forward_model import NEVER, StageCache, Term, predicted_residual
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Priors, Tolerance
from np_drake.diagnosis.regressors import (
    Candidate,
    Onset,
    at_value,
    calibration,
    library_candidates,
    payloads_of,
    wind_candidates,
)
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.effects.base import Effect
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay

# Squared whitened distance below which noise hides the difference; own choice: about four sigma.
DISTANCE = 14.0
TETHERS = np.geomspace(0.2, 2.0, 12)  # lengths of payloads that are compared [m]
Trace = Mapping[str, np.ndarray]  # by flight, (m, 15) residual in the channels of `FlightResiduals`


class Collinearity:
    """What explains a residual in these flights as well, up to noise and to what vehicle file and
    sensors are off by.

    Two explanations are the same where one comes within a squared whitened distance of the other.
    The parameters of effects are free; mass, thrust and sensors are free within tolerance.
    """

    def __init__(
        self, flights: Sequence[FlightResiduals], noise: NoiseModel, tolerance: Tolerance
    ) -> None:
        """Whiten the tolerated errors."""
        self._flights, self._noise = flights, noise
        files, drifting = calibration(flights, tolerance), flight_errors(flights, tolerance)
        self._files = self._columns(files)
        self._tolerated = self._columns([*files, *drifting])

    def contribution(self, terms: Sequence[Term], i: int) -> Trace:
        """Return what the predicted residual with terms[i] has over that without it."""
        rest = [t for j, t in enumerate(terms) if j != i]
        return {
            e.name: predicted_residual(e, terms) - predicted_residual(e, rest)
            for e in self._flights
        }

    def doubles(self, terms: Sequence[Term], i: int) -> list[str]:
        """Return the effects that are indistinguishable from terms[i], nearest first.

        Args:
            terms: of the model; what it holds is no double.
        """
        onset: Onset = {n: t for n, t in terms[i].onset.items() if t is not None and t != NEVER}
        known = {t.effect.identifier for t in terms}
        options = [*self._library(onset), *self._mirror_images(terms[i], onset)]
        options = [option for option in options if option.identifiers[-1] not in known]
        return self._same(self.contribution(terms, i), options, DISTANCE)

    def effects_of(self, trace: Trace, within: float = DISTANCE) -> list[str]:
        """Return the library effects that come near a residual, nearest first.
        Returns: identifiers; empty where mass, thrust and sensors within tolerance come as near by
            themselves.
        """
        return (
            [] if self._distance(trace) < within else self._same(trace, self._library({}), within)
        )

    def is_calibration(self, trace: Trace, within: float = DISTANCE) -> bool:
        """Return whether what vehicle file and input may be off by is the same as a residual.
        Returns: False where noise alone hides the residual.
        """
        target = self._whitened(trace)
        return self._distance(trace, tolerated=self._files) < within <= float(target @ target)

    def _same(self, trace: Trace, options: Sequence[Candidate], within: float) -> list[str]:
        found: dict[str, float] = {}
        for option in options:
            name = option.identifiers[-1]
            found[name] = min(self._distance(trace, option), found.get(name, np.inf))
        return sorted((n for n, d in found.items() if d < within), key=lambda n: found[n])

    def _library(self, onset: Onset) -> list[Candidate]:
        plain = library_candidates(self._flights, onset or None)
        payloads = [
            p.candidate(self._flights) for p in payloads_of(self._flights, TETHERS, Priors(), onset)
        ]
        return [*plain, *wind_candidates(self._flights, plain, onset), *payloads]

    def _mirror_images(self, term: Term, onset: Onset) -> list[Candidate]:
        """Return a delay and a clock offset of the size of the given shift, because they are not
        linear in it.
        """
        if not term.effect.pure_delay:
            return []
        delay = term.effect.time_shift(self._flights[0].vehicle)
        twins: list[tuple[type[Effect], dict[str, float]]] = [(ClockOffset, {"offset": -delay})]
        twins += [(CommandDelay, {"delay": delay})] if delay > 0 else []
        stages = {e.name: StageCache() for e in self._flights}
        return [
            at_value(effect, self._flights, onset, values, 1, stages)
            for effect, values in twins
            if not onset or effect.begins
        ]

    def _distance(
        self, trace: Trace, candidate: Candidate | None = None, tolerated: np.ndarray | None = None
    ) -> float:
        """Return the squared whitened distance of a residual from the span of a candidate and of
        tolerated errors.
        """
        X, target = self._tolerated if tolerated is None else tolerated, self._whitened(trace)
        if candidate is not None:
            X = np.hstack([X, self._columns([candidate])])
        # Ridge regression: min |target - X c|² + |c|² over c, whose penalty is the prior of
        # whitened columns.
        b = X.T @ target
        return float(target @ target - b @ np.linalg.solve(X.T @ X + np.eye(X.shape[1]), b))

    def _whitened(self, trace: Trace) -> np.ndarray:
        return np.concatenate([self._noise.whiten(trace[e.name]).ravel() for e in self._flights])

    def _columns(self, candidates: Sequence[Candidate]) -> np.ndarray:
        parts = []
        for e in self._flights:
            X = self._noise.whiten(np.concatenate([c.columns[e.name] for c in candidates], axis=-1))
            parts.append(X.reshape(-1, X.shape[-1]))
        return np.concatenate(parts)
