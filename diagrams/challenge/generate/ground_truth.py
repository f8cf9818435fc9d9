"""What truth.json holds of a case."""

import dataclasses as dc
from collections.abc import Sequence
from typing import Any

import numpy as np

from diagrams.challenge.generate.case import FILES, Case
from diagrams.challenge.generate.collinearity import Collinearity
from diagrams.challenge.generate.flight_pair import FlightPair, best_onset, left_by
from diagrams.challenge.generate.sensor_quality import WILD
from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.numerics import fit_noise
from np_drake.diagnosis.options import Options, Tolerance
from np_drake.diagnosis.regressors import tolerance_of, with_input
from np_drake.effects.base import Effect
from np_drake.flight_log import FlightLog

TRUTH_FILE = "truth.json"
NO_GAP = 1.1  # residual over what the true model leaves, pooled: less is no gap [1]
CHANNELS = tuple(
    f"{kind}_{axis}"
    for kind in ("force", "torque", "velocity", "acceleration", "rate")
    for axis in "xyz"
)


@dc.dataclass(frozen=True)
class GroundTruth:
    """A case, and its flights by file."""

    case: Case
    flights: dict[str, FlightPair]

    @classmethod
    def of(
        cls, case: Case, exact: dict[str, FlightLog], noisy: dict[str, FlightLog]
    ) -> "GroundTruth":
        """Return the truth of a case that was flown.

        Args:
            noisy: logs as measured by file, with the same rows.
        """
        return cls(
            case, {file: FlightPair.of(case, file, exact[file], noisy[file]) for file in FILES}
        )

    def content(self, simulator: str) -> dict[str, Any]:
        """Return the content of truth.json."""
        case, held_out = self.case, FILES[-1]
        onsets = {file: self.best_onset(file) for file in FILES}
        content = {
            "effects": [
                # An out-of-library effect has no parameters but its fields.
                {
                    "effect": e.identifier,
                    "parameters": e.values or dict(vars(e)),
                    "onset": case.onset,
                }
                for e in case.effects
            ],
            "class": self.collinear_class(),
            "true_model_residual": dict(
                zip(CHANNELS, self.flights[held_out].noise.tolist(), strict=True)
            ),
            "parameters_residual": dict(
                zip(CHANNELS, self.residual_of_true_parameters(held_out).tolist(), strict=True)
            ),
            "best_onset": {file: onset for file, onset in onsets.items() if onset is not None},
            "visibility": self.visibility(held_out),
            "visibility_in_training": {file: self.visibility(file) for file in FILES[:-1]},
            "visibility_of_each": self.visibility_of_each(held_out),
            "simulator": simulator,
            "quality": case.quality.name,
            "kind": case.draw.kind,
            "seed": case.seed,
            "index": case.draw.index,
            "attempt": case.draw.attempt,
            "vehicle_off": {"mass": case.quality.mass_off, "thrust": case.quality.thrust_off},
            "plans": {file: plan.kind for file, plan in case.plans.items()},
        }
        if case.quality.name == WILD:
            logged = {"input": case.input.kind, "semantics": case.input.semantics}
            content["within_tolerance"] = self.within_tolerance()
            content["sensors"] = {**logged, **dc.asdict(case.quality)}
        return content

    @property
    def out_of_library(self) -> bool:
        """Return whether the effects of the case are not in the library."""
        return self.case.draw.out_of_library

    def equivalent_library_effects(self) -> list[str]:
        """Return library effects that explain, in all flights, what the out-of-library effect of a
        case leaves there.

        A ceiling effect, for example, is a mass error to a vehicle that stays where its lift is
        even. The remainder must be of a visibility below `NO_GAP`, were all of it in one channel.
        """
        if not self.out_of_library:
            return []
        same, trace, within = self._left_by_all()
        return same.effects_of(trace, within)

    def collinear_class(self) -> list[list[str]]:
        """Return per effect the names that are physically the same in the training flights, its own
        first.

        Whitened with what noise really left there, so that nothing is solved for it.
        """
        effects = self.case.effects
        if not effects or self.out_of_library:
            return [[effect.identifier] for effect in effects]
        same, terms = self._collinearity(FILES[:-1]), self._terms(effects)
        return [[effect.identifier, *same.doubles(terms, i)] for i, effect in enumerate(effects)]

    def within_tolerance(self) -> list[bool]:
        """Return per effect whether it is the same, in all flights, as what vehicle file and input
        may be off by.

        Out-of-library effects are taken together.
        """
        if self.out_of_library:
            same, trace, within = self._left_by_all()
            return [same.is_calibration(trace, within)] * len(self.case.effects)
        same, terms = self._collinearity(FILES), self._terms(self.case.effects)
        return [same.is_calibration(same.contribution(terms, i)) for i in range(len(terms))]

    def _collinearity(self, files: Sequence[str]) -> Collinearity:
        """Return what is the same in these flights as measured, under the noise that the true model
        leaves.
        """
        pairs = [self.flights[file] for file in files]
        measured = [pair.measured for pair in pairs]
        noise = fit_noise([pair.errors for pair in pairs], measured[0].grid.step)
        return Collinearity(measured, noise, self.stated_tolerance(files))

    def _left_by_all(self) -> tuple[Collinearity, dict[str, np.ndarray], float]:
        """Return all flights, what all effects leave there (m, 15), and the squared distance of no
        gap.
        """
        trace = {
            pair.true.name: pair.true.y - self._background(pair) for pair in self.flights.values()
        }
        within = (NO_GAP**2 - 1.0) * sum(len(y) for y in trace.values())
        return self._collinearity(list(self.flights)), trace, within

    def stated_tolerance(self, files: Sequence[str] = FILES) -> Tolerance:
        """Return what vehicle file, input and sensors may be off by, as the files of a case state
        it.

        Of `wild` alone it holds what the vehicle file states, a throttle's scale and curve, and
        when commands act: the flights know all of these, but nobody else does.
        """
        flights = [self.flights[file].measured for file in files]
        tolerance, logged = tolerance_of(flights), self.case.input
        if self.case.quality.name != WILD:
            return tolerance
        told = [
            dc.replace(
                e,
                log=dc.replace(e.log, input=logged.kind, timing=logged.timing(e.log.step)),
                vehicle=dc.replace(e.vehicle, command_timing="held"),
            )
            for e in flights
        ]
        return with_input(Options.for_sensors(tolerance.real, tolerance), told).tolerance

    def visibility(self, file: str) -> float:
        """Return the largest ratio, over channels, of a flight's RMS to that which noise leaves to
        the true model [1].

        What the vehicle file is off by is no effect: it is taken out of the nominal residual.
        """
        pair = self.flights[file]
        total = np.sqrt(np.mean((pair.measured.y - self._background(pair)) ** 2, axis=0))
        return float(np.max(total / np.maximum(pair.noise, 1e-12)))

    def residual_of_true_parameters(self, file: str) -> np.ndarray:
        """Return the RMS (15,) that the true parameters leave: noise, and gusts, of which they give
        the strength.
        """
        case, pair = self.case, self.flights[file]
        if self.out_of_library or all(effect.predicted is effect for effect in case.effects):
            return pair.noise
        known = [*case.quality.background(case.vehicle), *(e.predicted for e in case.effects)]
        left = pair.true.y - left_by(pair.true, self._terms(known))
        return np.sqrt(pair.noise**2 + np.mean(left**2, axis=0))

    def best_onset(self, file: str) -> float | None:
        """Return `best_onset` of a flight [s]; None where nothing begins in it."""
        onset, pair = self.case.onset[file], self.flights[file]
        if onset is None or self.out_of_library:
            return None
        noise = fit_noise([pair.errors], pair.true.grid.step)
        return best_onset(
            pair.true, pair.errors, self._terms(self.case.effects_of(file)), onset, noise
        )

    def visibility_of_each(self, file: str) -> list[float]:
        """Return for every effect alone the largest ratio of noise with its trace to noise; NaN out
        of the library.
        """
        pair, effects = self.flights[file], self.case.effects_of(file)
        if self.out_of_library:
            return [float("nan")] * len(effects)
        terms, out = self._terms(effects), []
        for i in range(len(terms)):
            trace = left_by(pair.true, terms) - left_by(pair.true, terms[:i] + terms[i + 1 :])
            power = np.mean(trace**2, axis=0) / np.maximum(pair.noise, 1e-12) ** 2
            out.append(float(np.max(np.sqrt(1 + power))))
        return out

    def _terms(self, effects: Sequence[Effect]) -> list[Term]:
        return [Term(effect, dict(self.case.onset)) for effect in effects]

    def _background(self, pair: FlightPair) -> np.ndarray:
        """Return what the errors of the vehicle file leave (m, 15)."""
        return left_by(
            pair.true, [Term(effect) for effect in self.case.quality.background(self.case.vehicle)]
        )
