"""What truth.json holds of a case."""

import dataclasses as dc
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.challenge.generate.case import FILES, Case
from diagrams.challenge.generate.onset_bound import best_onset
from diagrams.challenge.score.gap_reduction import VISIBLE as NO_GAP
from np_drake.atomic_file import write_json
from np_drake.diagnosis.forward_model.prediction import predicted_residual
from np_drake.diagnosis.forward_model.term import Term
from np_drake.diagnosis.localisation.collinearity import collinear_effects, effects_of_trace
from np_drake.diagnosis.numerics.autoregressive_noise import fit_noise
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.regressors.nuisance import tolerance_of
from np_drake.diagnosis.residuals.flight_residuals import FlightResiduals, make_flight_residuals
from np_drake.effects.base import Effect
from np_drake.logs.flight_log import FlightLog

CHANNELS = tuple(
    f"{kind}_{axis}" for kind in ("force", "torque", "velocity", "acceleration", "rate") for axis in "xyz"
)


@dc.dataclass(frozen=True)
class Pair:
    """The evidence of one flight as it is measured, and as it would be without noise, on the same grid."""

    measured: FlightResiduals
    true: FlightResiduals

    @property
    def errors(self) -> np.ndarray:
        """(m, 15) what noise leaves to the true model."""
        return self.measured.y - self.true.y


def pairs_of(case: Case, exact: dict[str, FlightLog], noisy: dict[str, FlightLog]) -> dict[str, Pair]:
    """By file. exact, noisy: the logs by file, the same rows."""
    return {file: pair_of(case, file, exact[file], noisy[file]) for file in FILES}


def truth(case: Case, simulator: str, flights: dict[str, Pair]) -> dict:
    """The content of truth.json. flights: by file."""
    held_out = flights[FILES[-1]]
    residual, visibility = seen(case, held_out)
    return {
        "effects": [
            {"effect": e.identifier, "parameters": parameters(e), "onset": case.onset} for e in case.effects
        ],
        "class": collinear_class(case, [flights[file] for file in FILES[:-1]]),
        "true_model_residual": dict(zip(CHANNELS, residual.tolist(), strict=True)),
        "parameters_residual": dict(
            zip(CHANNELS, unforeseen(case, held_out, residual).tolist(), strict=True)
        ),
        "best_onset": {f: best for f in FILES if (best := knowable_onset(case, flights[f])) is not None},
        "visibility": visibility,
        "visibility_in_training": {f: seen(case, flights[f])[1] for f in FILES[:-1]},
        "visibility_of_each": own_visibility(case, held_out, residual),
        "simulator": simulator,
        "quality": case.quality.name,
        "kind": case.draw.kind,
        "seed": case.seed,
        "index": case.draw.index,
        "attempt": case.draw.attempt,
        "vehicle_off": {"mass": case.quality.mass_off, "thrust": case.quality.thrust_off},
        "plans": {file: plan.kind for file, plan in case.plans.items()},
    }


def pair_of(case: Case, file: str, exact: FlightLog, noisy: FlightLog) -> Pair:
    """Of a flight, named by its file: both from when on the measured one counts."""
    measured = make_flight_residuals(dc.replace(noisy, name=file), case.vehicle)
    since = float(measured.t[0])
    return Pair(measured, make_flight_residuals(dc.replace(exact, name=file), case.vehicle, since=since))


def looks_like(case: Case, flights: dict[str, Pair]) -> list[str]:
    """Effects of the library that leave, in all flights, what the foreign effect of a case leaves there.

    As a ceiling does whose lift is even above a height, of vehicles that stay there: it is a mass. What the nearest
    effect does not take is of a visibility below `NO_GAP`, were all of it in one channel.
    """
    off = [Term(effect) for effect in case.quality.background(case.vehicle)]
    measured = [pair.measured for pair in flights.values()]
    trace = {pair.true.name: pair.true.y - predicted_residual(pair.true, off) for pair in flights.values()}
    noise = fit_noise([pair.errors for pair in flights.values()], measured[0].grid.step)
    rows = sum(len(y) for y in trace.values())
    return effects_of_trace(
        measured, trace, noise, tolerance_of(measured), Priors(), (NO_GAP**2 - 1.0) * rows
    )


def parameters(effect: Effect) -> dict[str, Any]:
    """By name; of a foreign effect its fields."""
    return effect.values or dict(vars(effect))


def collinear_class(case: Case, training: list[Pair]) -> list[list[str]]:
    """Per effect the names that are physically the same in the training flights, its own first.

    Whitened with what noise really left there, so that nothing is solved for it.
    """
    if not case.effects or case.draw.kind == "foreign":
        return [[effect.identifier] for effect in case.effects]
    flights = [pair.measured for pair in training]
    noise = fit_noise([pair.errors for pair in training], flights[0].grid.step)
    terms = [Term(effect, dict(case.onset)) for effect in case.effects]
    tolerance, priors = tolerance_of(flights), Priors()
    return [
        [effect.identifier, *collinear_effects(flights, terms, i, noise, tolerance, priors)]
        for i, effect in enumerate(case.effects)
    ]


def seen(case: Case, flight: Pair) -> tuple[np.ndarray, float]:
    """RMS (15,) that noise leaves to the true model, and visibility: the largest ratio of a channel's RMS to it.

    What the vehicle file is off by is no effect: it is taken out of the nominal residual.
    """
    noise = np.sqrt(np.mean(flight.errors**2, axis=0))
    off = [Term(effect) for effect in case.quality.background(case.vehicle)]
    total = np.sqrt(np.mean((flight.measured.y - predicted_residual(flight.true, off)) ** 2, axis=0))
    return noise, float(np.max(total / np.maximum(noise, 1e-12)))


def unforeseen(case: Case, flight: Pair, noise: np.ndarray) -> np.ndarray:
    """RMS (15,) that the true parameters leave: noise, and gusts, of which they say how strong but not which."""
    if case.draw.kind == "foreign" or all(effect.foreseen is effect for effect in case.effects):
        return noise
    known = [*case.quality.background(case.vehicle), *(e.foreseen for e in case.effects)]
    left = flight.true.y - predicted_residual(
        flight.true, [Term(effect, dict(case.onset)) for effect in known]
    )
    return np.sqrt(noise**2 + np.mean(left**2, axis=0))


def knowable_onset(case: Case, flight: Pair) -> float | None:
    """What `best_onset` reads from a flight [s]; None where nothing begins in it."""
    file = flight.true.name
    onset = case.onset[file]
    if onset is None or case.draw.kind == "foreign":
        return None
    terms = [Term(effect, dict(case.onset)) for effect in case.effects_of(file)]
    noise = fit_noise([flight.errors], flight.true.grid.step)
    return best_onset(flight.true, flight.errors, terms, onset, noise)


def own_visibility(case: Case, flight: Pair, noise: np.ndarray) -> list[float]:
    """Of every effect alone: the largest ratio of noise with its trace to noise; NaN for foreign ones."""
    evidence, effects = flight.true, case.effects_of(FILES[-1])
    if case.draw.kind == "foreign":
        return [float("nan")] * len(effects)
    terms = [Term(effect, dict(case.onset)) for effect in effects]
    out = []
    for i in range(len(terms)):
        trace = predicted_residual(evidence, terms) - predicted_residual(evidence, terms[:i] + terms[i + 1 :])
        out.append(float(np.max(np.sqrt(1 + np.mean(trace**2, axis=0) / np.maximum(noise, 1e-12) ** 2))))
    return out


def write_truth(content: dict, folder: Path) -> None:
    """<folder>/truth.json."""
    write_json(folder / "truth.json", content)
