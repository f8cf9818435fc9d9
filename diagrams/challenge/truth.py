"""What truth.json holds of a case."""

import dataclasses as dc
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.challenge.case import FILES, Case
from diagrams.challenge.onset_bound import best_onset
from np_drake.atomic_file import write_json
from np_drake.diagnosis.collinear import collinear_effects
from np_drake.diagnosis.evidence import make_evidence
from np_drake.diagnosis.noise import fit_noise
from np_drake.diagnosis.rig import tolerance_of
from np_drake.diagnosis.signature import Term, signature
from np_drake.effects.base import Effect
from np_drake.logs.flight_log import FlightLog

CHANNELS = tuple(
    f"{kind}_{axis}" for kind in ("force", "torque", "velocity", "acceleration", "rate") for axis in "xyz"
)


def collinear_class(case: Case, exact: dict[str, FlightLog], noisy: dict[str, FlightLog]) -> list[list[str]]:
    """Per effect the names that are physically the same in the training flights, its own first.

    Whitened with what noise really left there (noisy less exact), so that nothing is solved for it.
    """
    training = [file for file in FILES[:-1] if file in noisy]
    if not case.effects or case.draw.kind == "foreign":
        return [[effect.identifier] for effect in case.effects]
    flights = [make_evidence(dc.replace(noisy[f], name=f), case.vehicle) for f in training]
    errors = [e.y - make_evidence(exact[f], case.vehicle).y for e, f in zip(flights, training, strict=True)]
    noise = fit_noise(errors, flights[0].grid.step)
    terms = [Term(effect, dict(case.onset)) for effect in case.effects]
    tolerance = tolerance_of(flights)
    return [
        [effect.identifier, *collinear_effects(flights, terms, i, noise, tolerance)]
        for i, effect in enumerate(case.effects)
    ]


def truth(case: Case, simulator: str, exact: dict[str, FlightLog], noisy: dict[str, FlightLog]) -> dict:
    """The content of truth.json. exact, noisy: the logs by file, the same rows."""
    held_out = FILES[-1]
    residual, visibility = seen(case, exact[held_out], noisy[held_out])
    return {
        "effects": [
            {"effect": e.identifier, "parameters": parameters(e), "onset": case.onset} for e in case.effects
        ],
        "class": collinear_class(case, exact, noisy),
        "true_model_residual": dict(zip(CHANNELS, residual.tolist(), strict=True)),
        "parameters_residual": dict(
            zip(CHANNELS, unforeseen(case, exact[held_out], residual).tolist(), strict=True)
        ),
        "best_onset": {f: best for f in FILES if (best := knowable_onset(case, exact, noisy, f)) is not None},
        "visibility": visibility,
        "visibility_in_training": {f: seen(case, exact[f], noisy[f])[1] for f in FILES[:-1]},
        "visibility_of_each": own_visibility(case, exact[held_out], residual),
        "simulator": simulator,
        "quality": case.quality.name,
        "kind": case.draw.kind,
        "seed": case.seed,
        "index": case.draw.index,
        "attempt": case.draw.attempt,
        "vehicle_off": {"mass": case.quality.mass_off, "thrust": case.quality.thrust_off},
        "plans": {file: plan.kind for file, plan in case.plans.items()},
    }


def parameters(effect: Effect) -> dict[str, Any]:
    """By name; of a foreign effect its fields."""
    return effect.values or dict(vars(effect))


def seen(case: Case, exact: FlightLog, noisy: FlightLog) -> tuple[np.ndarray, float]:
    """RMS (15,) that noise leaves to the true model, and visibility: the largest ratio of a channel's RMS to it.

    What the vehicle file is off by is no effect: it is taken out of the nominal residual.
    """
    with_noise, without = (make_evidence(log, case.vehicle) for log in (noisy, exact))
    noise = np.sqrt(np.mean((with_noise.y - without.y) ** 2, axis=0))
    off = [Term(effect) for effect in case.quality.background(case.vehicle)]
    total = np.sqrt(np.mean((with_noise.y - signature(without, off)) ** 2, axis=0))
    return noise, float(np.max(total / np.maximum(noise, 1e-12)))


def unforeseen(case: Case, exact: FlightLog, noise: np.ndarray) -> np.ndarray:
    """RMS (15,) that the true parameters leave: noise, and gusts, of which they say how strong but not which."""
    if case.draw.kind == "foreign" or all(effect.foreseen is effect for effect in case.effects):
        return noise
    evidence = make_evidence(dc.replace(exact, name=FILES[-1]), case.vehicle)
    known = [*case.quality.background(case.vehicle), *(e.foreseen for e in case.effects)]
    left = evidence.y - signature(evidence, [Term(effect, dict(case.onset)) for effect in known])
    return np.sqrt(noise**2 + np.mean(left**2, axis=0))


def knowable_onset(
    case: Case, exact: dict[str, FlightLog], noisy: dict[str, FlightLog], file: str
) -> float | None:
    """What `best_onset` reads from a flight [s]; None where nothing begins in it."""
    onset = case.onset[file]
    if onset is None or case.draw.kind == "foreign":
        return None
    measured, true = (
        make_evidence(dc.replace(logs[file], name=file), case.vehicle) for logs in (noisy, exact)
    )
    errors = measured.y - true.y
    terms = [Term(effect, dict(case.onset)) for effect in case.effects_of(file)]
    return best_onset(true, errors, terms, onset, fit_noise([errors], true.grid.step))


def own_visibility(case: Case, exact: FlightLog, noise: np.ndarray) -> list[float]:
    """Of every effect alone: the largest ratio of noise with its trace to noise; NaN for foreign ones."""
    evidence = make_evidence(dc.replace(exact, name=FILES[-1]), case.vehicle)
    effects = case.effects_of(FILES[-1])
    if case.draw.kind == "foreign":
        return [float("nan")] * len(effects)
    terms = [Term(effect, dict(case.onset)) for effect in effects]
    out = []
    for i in range(len(terms)):
        trace = signature(evidence, terms) - signature(evidence, terms[:i] + terms[i + 1 :])
        out.append(float(np.max(np.sqrt(1 + np.mean(trace**2, axis=0) / np.maximum(noise, 1e-12) ** 2))))
    return out


def write_truth(content: dict, folder: Path) -> None:
    """<folder>/truth.json."""
    write_json(folder / "truth.json", content)
