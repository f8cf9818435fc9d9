"""Step 3: which effects. Noise from the logs, search by evidence, onsets, refinement of all parameters."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.candidates import Candidate, library_candidates, wind_candidates
from np_drake.diagnosis.evidence import FORCE, TORQUE, Evidence
from np_drake.diagnosis.linear_bayes import gram
from np_drake.diagnosis.noise import NoiseModel, fit_noise, no_worse, no_worse_anywhere, scale_only
from np_drake.diagnosis.onset import ONSET_PRIOR, gated_candidates, late_payloads
from np_drake.diagnosis.payload_search import PayloadSearch
from np_drake.diagnosis.refine import Fit, refine
from np_drake.diagnosis.rig import Tolerance, calibration, calibration_terms, tolerance_of, wander
from np_drake.diagnosis.search import (
    MOST_EFFECTS,
    Model,
    Problem,
    effect_prior,
    library_first,
    search,
    sum_grams,
)
from np_drake.diagnosis.shocks import find_shocks
from np_drake.diagnosis.signature import NEVER, Term, signature
from np_drake.diagnosis.unknown import PREFIX, candidates_of_the_unknown

INEXACT = 0.03  # share of what linear columns explain that they get wrong; own choice
LEVER = 0.05  # at which a force may act that is known as well as the attitude is [m]; own choice
TOGETHER = 25.0  # rows over which errors hang together where structure remains: half a second; own choice
MOST_MEASURED = 8  # effects that are named where rotor speed is measured: real rotors have many; own choice
TEMPERATURE = 2.0  # noise is never quite its model: its variance counts this many times; own choice
REFINED = 3  # models that are refined
CLOSE = 12.0  # of the best's log evidence, below which a model is not worth it


@dc.dataclass(frozen=True)
class Ranking:
    """Models refined, best first, with the probability of every effect and the noise they were judged with.

    named: the effects of the best model without the generic structure beside them, which would share their figures.
    """

    fits: tuple[Fit, ...]
    named: Fit
    named_problem: Problem
    named_models: tuple[Model, ...]
    probability: dict[str, float]
    noise: NoiseModel
    problem: Problem
    models: tuple[Model, ...]
    tolerance: Tolerance


def rank(flights: Sequence[Evidence], *, tolerance: Tolerance | None = None) -> Ranking:
    """The models of these (training) flights, best first."""
    tolerance = tolerance or tolerance_of(flights)
    drifting = wander(flights, tolerance)
    nuisance = [*calibration(flights, tolerance), *([drifting] if drifting else [])]
    plain = library_candidates(flights)
    drags = [c for c in plain if c.identifiers == ("linear_drag",)]
    candidates = [*plain, *wind_candidates(flights, drags), *candidates_of_the_unknown(flights)]
    step = flights[0].grid.step
    raw = [e.y for e in flights]
    noise = scale_only(raw, step)
    late = gated_candidates(Problem(flights, noise, nuisance, candidates, temperature=TEMPERATURE))
    left = _rich_residuals(flights, noise, nuisance, [*candidates, *late])
    flights = [dc.replace(e, shocks=find_shocks(r, step)) for e, r in zip(flights, left, strict=True)]
    raw = [e.bridged(e.y) for e in flights]
    left = _rich_residuals(flights, scale_only(raw, step), nuisance, [*candidates, *late])
    noise = _noise(left, raw, step, tolerance, INEXACT)
    candidates += PayloadSearch(flights).best(
        scale_only(raw, step), nuisance, _best_variants(flights, noise, plain)
    )
    left = _rich_residuals(flights, noise, nuisance, [*candidates, *late])
    noise = _noise(left, raw, step, tolerance, INEXACT)
    best: Fit | None = None
    for first in (True, False):
        problem = Problem(flights, noise, nuisance, candidates, temperature=TEMPERATURE)
        late = gated_candidates(problem)
        hung = late_payloads(problem, late) if first else []
        candidates += hung
        if late or hung:
            problem = Problem(flights, noise, nuisance, [*candidates, *late], temperature=TEMPERATURE)
        models = library_first(problem, search(problem))
        best = _refine(problem, models[0], tolerance, best, iterations=3)
        residuals = [best.left(e) for e in flights]
        noise = _noise(residuals, raw, step, tolerance, INEXACT)
    assert best is not None
    noise = _noise(residuals, raw, step, tolerance)
    close = [m for m in _distinct(problem, models) if m.score > models[0].score - CLOSE]
    fits = [_refine(problem, m, tolerance, best, noise) for m in close[:REFINED]]
    fits.sort(key=lambda f: -_score(f))
    probability = _probabilities(problem, models, fits)
    named, named_problem, named_models = fits[0], problem, models
    if fits[0].generic and fits[0].terms:
        named, named_problem, named_models = _without_generic(problem, fits[0], raw, tolerance)
        structure = {n: p for n, p in probability.items() if n.startswith(PREFIX)}
        probability = _probabilities(named_problem, named_models, [named]) | structure
    return Ranking(
        tuple(fits),
        named,
        named_problem,
        tuple(named_models),
        probability,
        noise,
        problem,
        tuple(models),
        tolerance,
    )


def _noise(residuals, raw, step: float, tolerance: Tolerance, inexact: float = 0.0) -> NoiseModel:
    """Noise as residuals show it, and what errors of the regressors add to it.

    inexact: share of what a model explains that it gets wrong, `INEXACT` for columns that are only linear. A force is
    known in body axes as well as the attitude is, and so is its torque, at a lever of `LEVER`: slow, as a rig wanders.
    """
    explained = [y - r for y, r in zip(raw, residuals, strict=True)]
    force = np.sqrt(np.mean(np.sum(np.concatenate(explained)[:, FORCE] ** 2, axis=1)))
    slow = np.zeros(raw[0].shape[1])
    slow[FORCE], slow[TORQUE] = tolerance.attitude * force, tolerance.attitude * force * LEVER
    return fit_noise(no_worse(residuals, raw), step, explained=explained, inexact=inexact, slow=slow)


def _best_variants(flights, noise, candidates) -> list[Candidate]:
    """Of every effect the variant that explains most alone."""
    best: dict[tuple[str, ...], tuple[float, Candidate]] = {}
    for c in candidates:
        total = sum_grams([gram(e.white(noise, c.columns[e.name]), e.white(noise, e.y)) for e in flights])
        gain = total.log_evidence(np.arange(c.size))
        if c.identifiers not in best or gain > best[c.identifiers][0]:
            best[c.identifiers] = (gain, c)
    return [c for _, c in best.values()]


def _without_generic(
    problem: Problem, fit: Fit, raw: list[np.ndarray], tolerance: Tolerance
) -> tuple[Fit, Problem, list[Model]]:
    """The effects that explain most by themselves, where structure that is no effect remains beside them.

    What remains is no noise then, and weighting by its spectrum would bend the figures: plain least squares, channels
    made comparable, in which errors hang together (`TOGETHER`). With measured rotor speed every flight is weighted
    by what is left of it: that grows with how hard it is flown, and the loudest would decide for all.
    """
    flights, measured = problem.flights, problem.flights[0].measured_rotors
    candidates = [c for c in problem.candidates if not c.generic]
    for _ in range(4 if measured else 2):  # until weights rest
        left = [e.bridged(e.y - signature(e, fit.everything)) for e in flights]
        noise = _structured_noise(left, raw, flights)
        plain = Problem(flights, noise, problem.nuisance, candidates, temperature=TOGETHER)
        models = search(plain, most=MOST_MEASURED if measured else MOST_EFFECTS)
        fit = _refine(plain, models[0], tolerance, None, iterations=5)
    return fit, plain, models


def _structured_noise(
    left: list[np.ndarray], raw: list[np.ndarray], flights: Sequence[Evidence]
) -> NoiseModel:
    """What is left, as if it were white: as large in all flights; with measured rotor speed, as in each."""
    step = flights[0].grid.step
    if not flights[0].measured_rotors:
        return scale_only(no_worse(left, raw), step)
    return scale_only(no_worse_anywhere(left, raw), step, [e.name for e in flights])


def _rich_residuals(flights, noise, nuisance, candidates) -> list[np.ndarray]:
    """What is left of the channels when every effect helps, each in its best single variant."""
    chosen = [*nuisance, *_best_variants(flights, noise, candidates)]
    X = {e.name: np.concatenate([c.columns[e.name] for c in chosen], axis=-1) for e in flights}
    total = sum_grams([gram(e.white(noise, X[e.name]), e.white(noise, e.y)) for e in flights])
    mean, _ = total.posterior(np.arange(len(total.Xy)))
    return [e.bridged(e.y - X[e.name] @ mean) for e in flights]


def _refine(
    problem: Problem,
    model: Model,
    tolerance: Tolerance,
    known: Fit | None,
    noise: NoiseModel | None = None,
    iterations: int = 6,
) -> Fit:
    """A model's figures; where a fit of the same effects is known, from there."""
    index = problem.columns(model.members)
    mean, _ = problem.total.posterior(index)
    at = sum(c.size for c in problem.nuisance)
    terms: list[Term] = []
    for i in model.members:
        candidate = problem.candidates[i]
        terms += candidate.terms(mean[at : at + candidate.size])
        at += candidate.size
    if known is not None and _same(known.terms, terms):
        terms = list(known.terms)
    drifting = next((c.columns for c in problem.nuisance if c.variant == "wander"), None)
    return refine(
        terms,
        calibration_terms(problem.flights[0].vehicle, tolerance),
        problem.flights,
        noise or problem.noise,
        temperature=problem.temperature,
        wander=drifting,
        generic=[problem.candidates[i] for i in model.members if problem.candidates[i].generic],
        evaluations=iterations,
    )


def _same(a: Sequence[Term], b: Sequence[Term]) -> bool:
    """The same effects with the same onsets, in the same order."""
    return [(type(t.effect), t.onset) for t in a] == [(type(t.effect), t.onset) for t in b]


def _score(fit: Fit) -> float:
    prior = sum(effect_prior(t.effect.identifier) for t in fit.terms)
    prior += sum(effect_prior(g.candidate.identifiers[0]) + g.candidate.log_prior for g in fit.generic)
    onsets = sum(v is not None and v != NEVER for t in fit.terms for v in t.onset.values())
    return fit.log_evidence + prior + ONSET_PRIOR * onsets


def _distinct(problem: Problem, models: Sequence[Model]) -> list[Model]:
    """The best variant of each set of effects."""
    kept: dict[tuple[str, ...], Model] = {}
    for m in models:
        kept.setdefault(names_of(problem, m), m)
    return list(kept.values())


def names_of(problem: Problem, model: Model) -> tuple[str, ...]:
    """Identifiers of a model, sorted."""
    return tuple(sorted(name for i in model.members for name in problem.candidates[i].identifiers))


def names_of_fit(fit: Fit) -> tuple[str, ...]:
    """Identifiers of a fit, generic ones too, sorted."""
    generic = [name for g in fit.generic for name in g.candidate.identifiers]
    return tuple(sorted([*(t.effect.identifier for t in fit.terms), *generic]))


def _probabilities(problem: Problem, models: Sequence[Model], fits: Sequence[Fit]) -> dict[str, float]:
    """Of every effect: the share of the models that hold it, each with its (refined, where it is) evidence."""
    refined = {names_of_fit(f): _score(f) for f in fits}
    linear = {names_of(problem, m): m.score for m in _distinct(problem, models)[:200]}
    shift = max(refined.values()) - max(linear[n] for n in refined)
    scores = {n: refined.get(n, s + min(shift, 0.0)) for n, s in linear.items()}
    top = max(scores.values())
    weight = {n: np.exp(s - top) for n, s in scores.items()}
    total = sum(weight.values())
    names = {name for n in weight for name in n}
    return {name: float(sum(w for n, w in weight.items() if name in n) / total) for name in names}
