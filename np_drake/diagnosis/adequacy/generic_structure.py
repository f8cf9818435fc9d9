"""Generic structure: whether it is material, and whether held-out flights repeat it."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.adequacy.residual_tests import material_structure
from np_drake.diagnosis.fitting import Fit, Generic
from np_drake.diagnosis.forward_model import predicted_residual
from np_drake.diagnosis.held_out import HeldOut, adapt
from np_drake.diagnosis.materiality import Materiality
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.regressors import PREFIX
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.residuals import flight_residuals as ev
from np_drake.diagnosis.result import Finding
from np_drake.diagnosis.selection import Ranking


def material_shares(
    ranking: Ranking, generic: Sequence[tuple[Finding, bool]], repeats: Sequence[bool]
) -> list[float]:
    """Return the probabilities of structures that are material and that held-out flights do not contradict."""
    return [
        ranking.probability.get(PREFIX + f.name, 0.0)
        for (f, material), again in zip(generic, repeats, strict=True)
        if material and again and f.size > ranking.options.materiality.structure_share
    ]


def repeats_on_held_out(
    ranking: Ranking, fit: Fit, held_out: Sequence[FlightResiduals], held: HeldOut
) -> list[bool]:
    """Return for each structure whether it does no harm on held-out flights.

    Beside the effects that it was fitted with: those that are named without it may stand in its place.
    """
    gains = np.zeros(len(fit.generic))
    for e in held_out if fit.generic else ():
        rows = held.rows[e.name][ranking.noise.phi.shape[1] :]
        terms = adapt(fit.everything, e, ranking.noise, ranking.options.priors)
        parts = [g.part(e) for g in fit.generic]
        residual = e.y - predicted_residual(e, terms) - sum(parts)
        losses = [
            np.sum(e.white(ranking.noise, r)[rows] ** 2) for r in (residual, *(residual + p for p in parts))
        ]
        gains += 0.5 * (np.array(losses[1:]) - losses[0]) / ranking.problem.temperature
    return [bool(gain > ranking.options.thresholds.structure_harm) for gain in gains]


def generic_finding(
    generic: Generic, noise: NoiseModel, flights: Sequence[FlightResiduals], materiality: Materiality
) -> tuple[Finding, bool]:
    """Return the finding of a structure, and whether it is as material as an effect would have to be."""
    inverse = np.where(noise.rms > 0, 1 / np.maximum(noise.rms, 1e-12), 0.0)
    part = np.concatenate([generic.part(e) for e in flights])
    y = np.concatenate([e.y for e in flights])
    least_force, least_torque = material_structure(flights, materiality)
    force = np.sqrt(np.mean(np.sum(part[:, ev.FORCE] ** 2, axis=1)))
    torque = np.sqrt(np.mean(np.sum(part[:, ev.TORQUE] ** 2, axis=1)))
    own = np.sum((part * inverse) ** 2)
    gap = own / max(np.sum((y * inverse) ** 2) - y.shape[0] * np.sum(noise.rms > 0), own)
    material = force >= least_force or torque >= least_torque or gap >= materiality.gap
    candidate = generic.candidate
    figures = {"force": float(force), "torque": float(torque), **candidate.figures}
    name = candidate.identifiers[0].removeprefix(PREFIX)
    return Finding(name, candidate.variant, float(gap), figures), bool(material)
