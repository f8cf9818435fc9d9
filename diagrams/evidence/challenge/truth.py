"""What truth.json holds of a case: its effects, and what anybody could tell of them."""

import dataclasses as dc
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from diagrams.evidence.challenge.case import FILES, OUT_OF_LIBRARY, Case
from np_drake.diagnosis.calibration import file_errors, flight_errors
from np_drake.diagnosis.forward_model import NEVER, Stages, Term, predicted_residual
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.regressors import (
    Candidate,
    Onset,
    at_value,
    library_candidates,
    tolerance_of,
    wind_candidates,
)
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.diagnosis.selection.payload_search import payload_about, payload_of
from np_drake.effects.base import Effect
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.estimation.noise import fit_noise
from np_drake.flight_log import FlightLog

TRUTH_FILE = "truth.json"
NO_GAP = 1.1  # residual over what the true model leaves, pooled: less is no gap [1]
CHANNELS = tuple(
    f"{kind}_{axis}"
    for kind in ("force", "torque", "velocity", "acceleration", "rate")
    for axis in "xyz"
)
# Squared whitened distance below which noise hides the difference; own choice: about four sigma.
DISTANCE = 14.0
TETHERS = np.geomspace(0.2, 2.0, 12)  # lengths of payloads that are compared [m]
# By flight, (m, 15) residual in the channels of `FlightResiduals`, or (m, 15, k) columns.
Trace = Mapping[str, np.ndarray]


class FlightPair:
    """The residuals of one flight as measured, and without noise on the same grid.

    errors: (m, 15) what noise leaves to the true model; noise: its RMS (15,). background: (m, 15)
    what the errors of the vehicle file leave, in the channels that the log tells.
    """

    def __init__(self, case: Case, file: str, exact: FlightLog, noisy: FlightLog):
        """Take both logs of a flight, with the same rows, from where the measured one counts."""
        measured, true = (dc.replace(log, name=file) for log in (noisy, exact))
        self.measured = make_flight_residuals(measured, case.vehicle)
        since = float(self.measured.t[0])
        self.true = make_flight_residuals(true, case.vehicle, since=since)
        self.errors = self.measured.y - self.true.y
        self.noise = np.sqrt(np.mean(self.errors**2, axis=0))
        off = [Term(effect) for effect in case.quality.background(case.vehicle)]
        self.background = self.true.known(predicted_residual(self.true, off))


class Collinearity:
    """What explains a residual in these flights as measured as well, up to the noise that the true
    model leaves and to what vehicle file and sensors are off by.

    Two explanations are the same where one comes within a squared whitened distance of the other.
    The parameters of effects are free; mass, thrust and sensors are free within tolerance.
    """

    def __init__(self, pairs: Sequence[FlightPair]) -> None:
        """Whiten the tolerated errors."""
        self._flights = [pair.measured for pair in pairs]
        self._noise = fit_noise([pair.errors for pair in pairs], self._flights[0].grid.step)
        tolerance = tolerance_of(self._flights)
        errors = file_errors(self._flights, tolerance) + flight_errors(self._flights, tolerance)
        self._tolerated = self._white([error.columns for error in errors])

    def doubles(self, terms: Sequence[Term], i: int) -> list[str]:
        """Return the effects that are indistinguishable from terms[i], nearest first; what the
        other terms hold is no double.
        """
        onset: Onset = {n: t for n, t in terms[i].onset.items() if t is not None and t != NEVER}
        rest = [t for j, t in enumerate(terms) if j != i]
        trace = {
            e.name: predicted_residual(e, terms) - predicted_residual(e, rest)
            for e in self._flights
        }
        known = {t.effect.identifier for t in terms}
        options = [*self._library(onset), *self._mirror_images(terms[i], onset)]
        options = [option for option in options if option.identifiers[-1] not in known]
        return self._same(trace, options, DISTANCE)

    def effects_of(self, trace: Trace, within: float) -> list[str]:
        """Return the library effects that come near a residual, nearest first; none where mass,
        thrust and sensors within tolerance come as near by themselves.
        """
        if self._distance(trace, self._tolerated) < within:
            return []
        return self._same(trace, self._library({}), within)

    def _same(self, trace: Trace, options: Sequence[Candidate], within: float) -> list[str]:
        columns = (np.hstack([self._tolerated, self._white([o.columns])]) for o in options)
        distances = [self._distance(trace, X) for X in columns]
        names = [option.identifiers[-1] for option in options]
        nearest = sorted(zip(distances, names, strict=True))
        return list(dict.fromkeys(name for distance, name in nearest if distance < within))

    def _library(self, onset: Onset) -> list[Candidate]:
        plain = library_candidates(self._flights, onset or None)
        payloads = [
            payload_about(self._flights, payload_of(length, onset), Priors(), shaped=False)
            for length in TETHERS.tolist()
        ]
        winds = wind_candidates(self._flights, plain, onset)
        return [*plain, *winds, *(p.candidate(self._flights) for p in payloads)]

    def _mirror_images(self, term: Term, onset: Onset) -> list[Candidate]:
        """Return a delay and a clock offset of the size of the given shift, because they are not
        linear in it.
        """
        if not term.effect.pure_delay:
            return []
        delay = term.effect.time_shift(self._flights[0].vehicle)
        twins: list[tuple[type[Effect], dict[str, float]]] = [(ClockOffset, {"offset": -delay})]
        twins += [(CommandDelay, {"delay": delay})] if delay > 0 else []
        stages: dict[str, Stages] = {e.name: {} for e in self._flights}
        return [
            at_value(effect, self._flights, onset, values, 1, stages)
            for effect, values in twins
            if not onset or effect.begins
        ]

    def _distance(self, trace: Trace, X: np.ndarray) -> float:
        """Return the squared whitened distance of a residual from the span of X."""
        # Ridge regression: min |target - X c|² + |c|² over c, whose penalty is the prior of
        # whitened columns.
        target = self._white([{name: y[..., None] for name, y in trace.items()}])[:, 0]
        b = X.T @ target
        return float(target @ target - b @ np.linalg.solve(X.T @ X + np.eye(X.shape[1]), b))

    def _white(self, columns: Sequence[Trace]) -> np.ndarray:
        """Return columns (m, 15, k) by flight side by side, whitened, those of all flights below
        one another.
        """
        joined = (np.concatenate([X[e.name] for X in columns], axis=-1) for e in self._flights)
        white = [self._noise.whiten(X) for X in joined]
        return np.concatenate([X.reshape(-1, X.shape[-1]) for X in white])


class GroundTruth:
    """A case that was flown, and its flights by file."""

    def __init__(self, case: Case, exact: dict[str, FlightLog], noisy: dict[str, FlightLog]):
        """Take both logs of every flight."""
        self.case = case
        self.flights = {file: FlightPair(case, file, exact[file], noisy[file]) for file in FILES}

    def content(self) -> dict[str, Any]:
        """Return the content of truth.json."""
        case = self.case
        held_out = FILES[-1]
        quality = case.quality
        noise = self.flights[held_out].noise
        return {
            "effects": [
                {"effect": e.identifier, "parameters": e.values, "onset": case.onset}
                for e in case.effects
            ],
            "class": self.collinear_class(),
            "true_model_residual": dict(zip(CHANNELS, noise.tolist(), strict=True)),
            "visibility": self.visibility(held_out),
            "visibility_in_training": {file: self.visibility(file) for file in FILES[:-1]},
            "simulator": case.request.simulator,
            "quality": quality.name,
            "kind": case.draw.kind,
            "seed": case.request.seed,
            "index": case.draw.index,
            "attempt": case.draw.attempt,
            "vehicle_off": {"mass": quality.mass_off, "thrust": quality.thrust_off},
            "plans": {file: plan.kind for file, plan in case.plans.items()},
            "seconds": case.request.seconds,
        }

    def equivalent_library_effects(self) -> list[str]:
        """Return library effects that explain, in all flights, what the out-of-library effect of a
        case leaves there.

        A ceiling effect, for example, is a mass error to a vehicle that stays where its lift is
        even. The remainder must be of a visibility below `NO_GAP`, were all of it in one channel.
        """
        if self.case.draw.kind != OUT_OF_LIBRARY:
            return []
        trace = {file: pair.true.y - pair.background for file, pair in self.flights.items()}
        within = (NO_GAP**2 - 1.0) * sum(len(y) for y in trace.values())
        return Collinearity(list(self.flights.values())).effects_of(trace, within)

    def collinear_class(self) -> list[list[str]]:
        """Return per effect the names that are physically the same in the training flights, its own
        first.
        """
        effects = self.case.effects
        if not effects or self.case.draw.kind == OUT_OF_LIBRARY:
            return [[effect.identifier] for effect in effects]
        same = Collinearity([self.flights[file] for file in FILES[:-1]])
        terms = [Term(effect, dict(self.case.onset)) for effect in effects]
        return [[effect.identifier, *same.doubles(terms, i)] for i, effect in enumerate(effects)]

    def visibility(self, file: str) -> float:
        """Return the largest ratio, over channels, of a flight's RMS to that which noise leaves to
        the true model [1].

        What the vehicle file is off by is no effect: it is taken out of the nominal residual.
        """
        pair = self.flights[file]
        total = np.sqrt(np.mean((pair.measured.y - pair.background) ** 2, axis=0))
        return float(np.max(total / np.maximum(pair.noise, 1e-12)))
