"""What is left once the causes are taken out: is it noise, or something the library does not have?"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.adequacy.residual_statistics import slow_torque, strongest_line
from np_drake.diagnosis.adequacy.residual_tests import (
    FAINT,
    LEAST_SHARE,
    SWUNG,
    UNSEEN,
    Indication,
    beyond_bounds,
    irregularities,
    least_lines,
    line_test,
    material_structure,
    novel_on_held_out,
    slow_torque_test,
)
from np_drake.diagnosis.fitting.map_estimate import Fit, Generic
from np_drake.diagnosis.fitting.resonance_fit import mode_of
from np_drake.diagnosis.forward_model.prediction import predicted_residual
from np_drake.diagnosis.held_out.adaptation import adapt
from np_drake.diagnosis.held_out.prediction import HeldOut, on_held_out
from np_drake.diagnosis.materiality import EXACT, MATERIAL_FORCE, MATERIAL_GAP
from np_drake.diagnosis.numerics.autoregressive_noise import NoiseModel
from np_drake.diagnosis.regressors.generic import PREFIX
from np_drake.diagnosis.regressors.library import DRAG
from np_drake.diagnosis.residuals import flight_residuals as ev
from np_drake.diagnosis.residuals.flight_residuals import FlightResiduals
from np_drake.diagnosis.result import Finding
from np_drake.diagnosis.selection.ranking import Ranking
from np_drake.diagnosis.tolerance import Tolerance
from np_drake.diagnosis.wind.slow_force import LEAST, slow_force, slow_power

HARM = -1.0  # log likelihood on unseen flights below which a structure does not repeat


@dc.dataclass(frozen=True)
class Unexplained:
    """unknown: is something material left?   findings: where it lives.   held: the fit on unseen flights.

    structured: with measured rotor speed, is there structure beside the effects, whether or not it repeats?
    """

    unknown: bool
    probability: float
    findings: tuple[Finding, ...]
    held: HeldOut
    slow_probability: float
    structured: bool = False

    @property
    def novel_on_held_out(self) -> bool:
        """Do unseen flights alone show something?"""
        return any(f.name == UNSEEN for f in self.findings)


def find_unexplained(
    ranking: Ranking, fit: Fit, flights: Sequence[FlightResiduals], held_out: Sequence[FlightResiduals]
) -> Unexplained:
    """The generic structure of the fit, and what is odd in what is left of all flights."""
    tolerance, named = ranking.tolerance, ranking.named
    structured = bool(ranking.fits[0].generic) and flights[0].measured_rotors
    held = on_held_out(named, held_out, ranking.noise, structured=structured)
    residual = {e.name: fit.residual(e) for e in flights}
    swung = {e.name: swing_free_residual(held, e) for e in held_out}
    hidden = any(t.swings for t in named.terms)
    slowly = gust_probability(named, tolerance, flights, residual, held_out, swung)
    gusty = slowly > 0.5
    line, torque = (
        strongest_line(flights, residual, least_lines(flights, tolerance)),
        slow_torque(flights, residual),
    )
    said: list[Indication] = []
    if not (hidden or gusty):
        rest = {e.name: named.residual(e) for e in flights} | swung
        said += irregularities([*flights, *held_out], rest, tolerance)
    if not hidden:
        said.append(novel_on_held_out(held_out, swung, tolerance, slow_power(flights, residual), gusty=gusty))
    said += beyond_bounds(named, flights[0].vehicle, gusty=gusty)
    said.append(line_test(line, flights, held_out, swung, tolerance))
    said.append(slow_torque_test(torque, flights, held_out, swung, tolerance, hidden=hidden))
    generic = [_generic(g, ranking.noise, flights) for g in fit.generic]
    shares = _shares(ranking, generic, _repeat(ranking, fit, held_out, held))
    probability = max([*shares, *(p for p, _ in said)])
    findings = (*(f for f, _ in generic), *(f for p, f in said if p > 0.5))
    return Unexplained(probability > 0.5, probability, findings, held, slowly, structured)


def _shares(
    ranking: Ranking, generic: Sequence[tuple[Finding, bool]], repeats: Sequence[bool]
) -> list[float]:
    """Probabilities of the structures that are material and that unseen flights do not contradict."""
    return [
        ranking.probability.get(PREFIX + f.name, 0.0)
        for (f, material), again in zip(generic, repeats, strict=True)
        if material and again and f.size > LEAST_SHARE
    ]


def _repeat(ranking: Ranking, fit: Fit, held_out: Sequence[FlightResiduals], held: HeldOut) -> list[bool]:
    """Of each structure: does it help on flights that it was not fitted to, or at least do no harm there?

    Beside the effects that it was fitted with: those that are named without it may stand in its place.
    """
    gains = np.zeros(len(fit.generic))
    for e in held_out if fit.generic else ():
        rows = held.rows[e.name][ranking.noise.phi.shape[1] :]
        terms = adapt(fit.everything, e, ranking.noise)
        parts = [g.part(e) for g in fit.generic]
        residual = e.y - predicted_residual(e, terms) - sum(parts)
        losses = [
            np.sum(e.white(ranking.noise, r)[rows] ** 2) for r in (residual, *(residual + p for p in parts))
        ]
        gains += 0.5 * (np.array(losses[1:]) - losses[0]) / ranking.problem.temperature
    return [bool(gain > HARM) for gain in gains]


def swing_free_residual(held: HeldOut, e: FlightResiduals) -> np.ndarray:
    """(m, 15) what is left of an unseen flight whatever a payload's hidden swing was, shocks apart."""
    return e.bridged(e.y - predicted_residual(e, held.whole_flight_terms[e.name]))


def gust_probability(
    named: Fit,
    tolerance: Tolerance,
    flights: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    held_out: Sequence[FlightResiduals],
    swung: dict[str, np.ndarray],
) -> float:
    """Probability of a force in the air in what is left of all flights: none where those of the fit show none.

    A drag that was found would feel it however small it is; where none was, it is a matter if it is as large as an
    effect has to be.
    """
    seen = slow_force(flights, residual, tolerance)
    both = slow_force([*flights, *held_out], residual | swung, tolerance)
    felt = any(t.effect.identifier == DRAG for t in named.terms)
    vehicle = flights[0].vehicle
    least = MATERIAL_FORCE * (1.0 if tolerance.real else EXACT)
    matters = felt or both.deviation > least * vehicle.mass * vehicle.gravity
    shown = seen.log_evidence > FAINT * LEAST[felt]
    lost = any(t.swings for t in named.terms) and slow_power(flights, residual) < SWUNG * slow_power(
        flights, {e.name: e.y for e in flights}
    )
    return both.probability(felt=felt) if matters and shown and not lost else 0.0


def _generic(generic: Generic, noise: NoiseModel, flights: Sequence[FlightResiduals]) -> tuple[Finding, bool]:
    """A finding, and whether it is material as an effect would be."""
    inverse = np.where(noise.rms > 0, 1 / np.maximum(noise.rms, 1e-12), 0.0)
    part = np.concatenate([generic.part(e) for e in flights])
    y = np.concatenate([e.y for e in flights])
    least_force, least_torque = material_structure(flights)
    force = np.sqrt(np.mean(np.sum(part[:, ev.FORCE] ** 2, axis=1)))
    torque = np.sqrt(np.mean(np.sum(part[:, ev.TORQUE] ** 2, axis=1)))
    own = np.sum((part * inverse) ** 2)
    gap = own / max(np.sum((y * inverse) ** 2) - y.shape[0] * np.sum(noise.rms > 0), own)
    material = force >= least_force or torque >= least_torque or gap >= MATERIAL_GAP
    candidate = generic.candidate
    figures = {"force": float(force), "torque": float(torque), **candidate.figures}
    name = candidate.identifiers[0].removeprefix(PREFIX)
    return Finding(name, candidate.variant, float(gap), figures), bool(material)


def with_fitted_resonances(residual: Unexplained, ranking: Ranking) -> Unexplained:
    """The same, with frequency and damping of what swings fitted: they are for the answer alone, and take a while."""
    fit, flights = ranking.fits[0], ranking.problem.flights
    rest = {e.name: fit.residual(e) for e in flights}
    swinging = [g for g in fit.generic if g.candidate.swing is not None]
    modes = {g.candidate.variant: mode_of(g, flights, rest, ranking.noise) for g in swinging}
    return dc.replace(residual, findings=tuple(_with_mode(f, modes.get(f.text)) for f in residual.findings))


def _with_mode(finding: Finding, mode: tuple[float, float] | None) -> Finding:
    if mode is None:
        return finding
    frequency, damping = mode
    figures = finding.figures | {"frequency": frequency, "damping": damping}
    text = f"{finding.text}; fitted: {frequency:.3g} Hz, damping {damping:.2g}"
    return dc.replace(finding, text=text, figures=figures)
