"""Search for the MAP model, and its ranking among its rivals.

Outliers, nuisance and the noise if all candidates help are settled first (`condition`); then search
and fit are repeated with the noise that the fit leaves (`find_map_model`); then the best model and
its rivals are refined in all their parameters (`rank_models`).
"""

import dataclasses as dc
from collections.abc import Iterable, Sequence
from functools import partial

import numpy as np
import scipy

from np_drake.diagnosis.calibration import calibrated_alone, nuisance_of
from np_drake.diagnosis.fitting import Fit, first_fit, greatest_height, impossible, refit, restart
from np_drake.diagnosis.forward_model import NEVER, predicted_residual
from np_drake.diagnosis.options import Options, Priors
from np_drake.diagnosis.regressors import (
    PAYLOAD,
    Model,
    RegressionProblem,
    hidden_from,
    library_candidates,
    options_of,
    prior_of,
    switched,
    widen_tolerance,
    wind_candidates,
)
from np_drake.diagnosis.residuals import FORCE, FlightResiduals, find_outliers
from np_drake.diagnosis.selection.change_point import (
    OnsetScan,
    changing_payloads,
    late_payloads,
    new_conditions,
    switched_candidates,
)
from np_drake.diagnosis.selection.payload_search import PayloadSearch
from np_drake.effects.library import effect_of
from np_drake.estimation.noise import NoiseModel, fit_noise, no_worse, scale_only, with_loudness
from np_drake.estimation.regression import places


def condition(
    flights: Sequence[FlightResiduals],
    options: Options,
    *,
    still_air: bool = False,
    lengths: np.ndarray | None = None,
) -> RegressionProblem:
    """Return the problem with outliers, payloads and noise as they show when every effect helps.

    Args:
        still_air: whether no wind acts in all flights; one that begins, or that some lack, is tried
            all the same.
        lengths: of tethers (n,) that are searched [m]; default: `search_lengths`.
    """
    error = options.priors.linear_error
    step = flights[0].grid.step
    nuisance = nuisance_of(flights, options.tolerance, options.priors)
    known = calibrated_alone(flights[0], options.tolerance)
    plain = [
        dc.replace(c, calibrated=c.identifiers[0] in known) for c in library_candidates(flights)
    ]
    candidates = [*plain, *([] if still_air else wind_candidates(flights, plain))]

    problem = partial(RegressionProblem, nuisance=nuisance, temperature=1.0, options=options)
    temperature = options.priors.temperature

    # 1. Outliers, by what is left of the channels under white weights.
    white = scale_only([flight.y for flight in flights], step)
    sought = problem(flights, white, candidates=candidates, temperature=temperature)
    everything = [*candidates, *switched_candidates(OnsetScan(sought)), *new_conditions(sought)]
    residual = _residuals_of_all_effects(problem(flights, white, candidates=everything))
    marked = [
        flight.revised(outliers=flight.outliers | find_outliers(r, step))
        for flight, r in zip(flights, residual, strict=True)
    ]
    channels = [flight.bridged(flight.y) for flight in marked]
    white = scale_only(channels, step)
    if any(flight.outliers.any() for flight in marked):
        residual = _residuals_of_all_effects(problem(marked, white, candidates=everything))

    # 2. Payloads, beside the best variant of every other effect.
    noise = noise_of(marked, residual, channels, options, error)
    alone = problem(marked, noise, nuisance=[], candidates=plain)
    others = [plain[i] for i in _best_variants(alone)]
    after_others = _residuals_of_all_effects(problem(marked, white, candidates=others))
    # A light payload shows in the second alone.
    weights = (white, scale_only(no_worse(after_others, channels), step))
    search = PayloadSearch(
        [flight for flight in marked if not flight.earlier], options, lengths=lengths
    )
    tried = () if PAYLOAD in hidden_from(marked) else weights
    followed = next(filter(None, (search.followed(n, nuisance, others) for n in tried)), [])
    payloads = [candidate for _, candidate in followed]
    if earlier := dict[str, float | None](
        (flight.name, NEVER) for flight in marked if flight.earlier
    ):
        payloads = [switched(c, marked, earlier) for c in payloads]

    # 3. Noise. A swing that is not fitted yet is a resonance of the noise, which would hide it:
    # white weights do not.
    first = weights[1] if payloads else noise
    residual = _residuals_of_all_effects(
        problem(marked, first, candidates=[*everything, *payloads])
    )
    noise = noise_of(marked, residual, channels, options, error)
    return problem(marked, noise, candidates=[*candidates, *payloads], temperature=temperature)


def noise_of(
    flights: Sequence[FlightResiduals],
    residuals: Sequence[np.ndarray],
    channels: Sequence[np.ndarray],
    options: Options,
    inexact: float = 0.0,
) -> NoiseModel:
    """Return the noise that residuals show, with what errors of the regressors add to it.

    A force is known in body axes as well as the attitude is: slow, as real sensors drift.
    Thrust from rotor speed is known as well as that is read.

    Args:
        residuals: (m, 15) by flight, after a model.
        channels: (m, 15) by flight, before it.
        inexact: share of what the model explains that it gets wrong [1]; `linear_error` for linear
            columns.
    """
    residuals = [flight.known(r) for flight, r in zip(flights, residuals, strict=True)]
    explained = [y - r for y, r in zip(channels, residuals, strict=True)]
    force = np.sqrt(np.mean(np.sum(np.concatenate(explained)[:, FORCE] ** 2, axis=1)))
    slow = np.zeros(channels[0].shape[1])
    slow[FORCE] = options.tolerance.attitude * force
    white = np.sqrt(np.mean([flight.rotor_noise**2 for flight in flights], axis=0))
    remaining = no_worse(residuals, list(channels))
    noise = fit_noise(
        remaining,
        flights[0].grid.step,
        explained=explained,
        inexact=inexact,
        slow=slow,
        white=white,
    )
    if not flights[0].measured_rotors:
        return noise
    return with_loudness(
        noise, [r - r.mean(axis=0) for r in remaining], [flight.name for flight in flights]
    )


def _best_variants(problem: RegressionProblem) -> list[int]:
    """Return of every effect the position of the variant that explains most alone."""
    best: dict[tuple[str, ...], tuple[float, int]] = {}
    for i, c in enumerate(problem.candidates):
        gain = problem.total.log_evidence(problem.columns_of(i))
        if c.identifiers not in best or gain > best[c.identifiers][0]:
            best[c.identifiers] = (gain, i)
    return [i for _, i in best.values()]


def _residuals_of_all_effects(problem: RegressionProblem) -> list[np.ndarray]:
    """Return what is left of the channels when every effect helps, each in its best single
    variant.
    """
    chosen = _best_variants(problem)
    mean, _ = problem.total.posterior(problem.columns(chosen))
    columns = [*problem.nuisance, *(problem.candidates[i] for i in chosen)]
    parts = list(zip(columns, places(c.size for c in columns), strict=True))
    return [
        flight.known(
            flight.bridged(
                flight.y - sum(c.columns[flight.name] @ mean[place] for c, place in parts)
            )
        )
        for flight in problem.flights
    ]


BEAM = 6  # sets kept from step to step
BEAM_MARGIN = 8.0  # log evidence below the best at which the beam stops growing
MOST_EFFECTS = 8  # in a model


@dc.dataclass(frozen=True)
class Ranking:
    """Fitted models, best first, with the noise, all models met, best first, and the probability of
    every effect, which is known once the best is ranked among its rivals.
    """

    fits: tuple[Fit, ...]
    noise: NoiseModel
    problem: RegressionProblem
    models: tuple[Model, ...]
    options: Options
    probability: dict[str, float] = dc.field(default_factory=dict)

    @property
    def best(self) -> Fit:
        """The most probable model."""
        return self.fits[0]


def find_map_model(
    flights: Sequence[FlightResiduals],
    options: Options | None = None,
    *,
    still_air: bool = False,
    lengths: np.ndarray | None = None,
) -> Ranking:
    """Return the best model of these training flights, searched and fitted twice: once more with
    the noise that the fit leaves.

    options: all that steers the answer; default: as the logs look (`tolerance_of`). still_air,
    lengths: as of `condition`.
    """
    options = widen_tolerance(options, flights) if options else options_of(flights)
    conditioned = condition(flights, options, still_air=still_air, lengths=lengths)

    # Once with the noise if all candidates help.
    scan = OnsetScan(conditioned)
    late = switched_candidates(scan)
    hung = [*late_payloads(scan, late, lengths), *changing_payloads(conditioned, lengths)]
    settled = conditioned.extended(hung)
    problem = settled.extended([*late, *new_conditions(settled)])
    best_set = search(problem)[0]
    fit = first_fit(problem, best_set, iterations=3)

    # Once more with the noise that this fit leaves, and onsets beside the effects of this fit.
    acting = [problem.candidates[i] for i in best_set.members]
    begun = [c for c in acting if c.onset and not any(c is other for other in settled.candidates)]
    noise = _noise_left(fit, conditioned, options.priors.linear_error)
    settled = conditioned.extended([*hung, *begun], noise)
    members = [i for i, c in enumerate(settled.candidates) if any(c is a for a in acting)]
    late = switched_candidates(OnsetScan(settled, members))
    problem = settled.extended([*late, *new_conditions(settled)])
    models = search(problem)
    fit = refit(problem, models[0], fit, iterations=3)
    return Ranking((fit,), _noise_left(fit, conditioned), problem, tuple(models), options)


def _noise_left(fit: Fit, problem: RegressionProblem, inexact: float = 0.0) -> NoiseModel:
    """Return the noise that a fit leaves in the flights of a problem; inexact: as of `noise_of`."""
    channels = [flight.bridged(flight.y) for flight in problem.flights]
    residuals = [fit.residual(flight) for flight in problem.flights]
    return noise_of(problem.flights, residuals, channels, problem.options, inexact)


def search(problem: RegressionProblem) -> list[Model]:
    """Return all models met, best first.

    A beam grows by one candidate at a time, then the best is swapped and reduced until it rests.
    """
    seen: dict[tuple[int, ...], float] = {(): 0.0}

    def score_all(sets: Iterable[tuple[int, ...]]) -> None:
        new = [members for members in sets if members not in seen]
        seen.update(zip(new, problem.scores(new), strict=True))

    def with_one_more(members: tuple[int, ...], but: tuple[int, ...]) -> set[tuple[int, ...]]:
        """Return the sets of these members and one candidate, but not these."""
        return {
            tuple(sorted((*members, i)))
            for i in range(len(problem.candidates))
            if i not in but and problem.fits_together((*members, i))
        }

    layer: list[tuple[int, ...]] = [()]
    for _ in range(MOST_EFFECTS):
        grown = {one for m in layer for one in with_one_more(m, m)}
        if not grown:
            break
        score_all(grown)
        # The best of each set of effects: variants of one effect must not fill the beam.
        kept: dict[tuple[str, ...], tuple[int, ...]] = {}
        for members in sorted(grown, key=lambda m: (-seen[m], m)):
            if len(kept) < BEAM:
                kept.setdefault(names_of(problem, Model(members, seen[members])), members)
        layer = list(kept.values())
        if seen[layer[0]] < max(seen.values()) - BEAM_MARGIN:
            break
    current = max(seen, key=lambda m: seen[m])
    while True:
        better = set()
        for out in current:  # one candidate fewer, or one exchanged
            rest = tuple(i for i in current if i != out)
            better |= {rest, *with_one_more(rest, current)}
        score_all(better)
        candidate = max(better, key=lambda m: seen[m], default=current)
        if seen[candidate] <= seen[current]:
            break
        current = candidate
    return [Model(m, s) for m, s in sorted(seen.items(), key=lambda item: -item[1]) if s > -np.inf]


REFINED = 3  # models refined, with these less their negligible effects
RANKING_MARGIN = 12.0  # log evidence below the best at which a model is not refined
# whitened size over that of all, below which a model is tried without an effect [1]
NEGLIGIBLE = 0.1


def rank_models(searched: Ranking) -> Ranking:
    """Return the best model ranked among its rivals, each refined: those that come close to it, and
    the best without its faint effects.
    """
    problem = searched.problem
    noise = searched.noise
    priors = searched.problem.options.priors
    least = searched.models[0].score - RANKING_MARGIN
    close = [m for m in _distinct(problem, searched.models) if m.score > least]
    refined = {m: refit(problem, m, searched.best, noise) for m in close[:REFINED]}
    first = max(refined, key=lambda m: score_of(refined[m], priors))
    best = refined[first] = restart(problem, refined[first], noise)
    for m in drop_negligible(problem, first, best):
        if m not in refined:
            names = names_of(problem, m)
            kept = tuple(t for t in best.terms if t.effect.identifier in names)
            refined[m] = refit(problem, m, dc.replace(best, terms=kept), noise)
    models = [*searched.models, *(m for m in refined if m not in searched.models)]
    vehicle = problem.flights[0].vehicle
    height = greatest_height(problem.flights)
    possible = [
        fit
        for fit in refined.values()
        if not any(impossible(fit, i, vehicle, height) for i in range(len(fit.terms)))
    ]
    fits = sorted(possible or refined.values(), key=lambda f: -score_of(f, priors))
    return dc.replace(
        searched,
        fits=tuple(fits),
        models=tuple(models),
        probability=probabilities(problem, models, fits),
    )


def probabilities(
    problem: RegressionProblem, models: Sequence[Model], fits: Sequence[Fit]
) -> dict[str, float]:
    """Return for every effect the share of evidence of the models that hold it [1]."""
    priors = problem.options.priors
    scored = sorted((score_of(f, priors), k) for k, f in enumerate(fits))
    refined = {names_of_fit(fits[k]): score for score, k in scored}
    linear = {names_of(problem, m): m.score for m in _distinct(problem, models)[:200]}
    shift = scored[-1][0] - max((linear[n] for n in refined if n in linear), default=scored[-1][0])
    scores = {n: s + min(shift, 0.0) for n, s in linear.items()} | refined
    weight = dict(zip(scores, scipy.special.softmax(list(scores.values())), strict=True))
    names = {name for n in weight for name in n}
    return {name: float(sum(w for n, w in weight.items() if name in n)) for name in names}


def drop_negligible(problem: RegressionProblem, model: Model, fit: Fit) -> list[Model]:
    """Return the model without its faint effects, all and each.

    Faint is an effect whose whitened predicted residual is less than the share `NEGLIGIBLE` of that
    of all: what linear columns get wrong. And one that shifts commands against states beside
    another that shifts them more: these are tried a third apart, and all of them, as a lag that is
    shorter than the vehicle file's and a delay may stand for that lag.
    """
    flights = problem.flights
    terms = fit.everything

    def trace(names: Sequence[str]) -> float:
        """Return the whitened size of what these effects leave in the flights."""
        rest = [t for t in terms if t.effect.identifier not in names]
        white = (
            flight.white(
                problem.noise, predicted_residual(flight, terms) - predicted_residual(flight, rest)
            )
            for flight in flights
        )
        return float(np.sqrt(sum(np.sum(w**2) for w in white)))

    effects = {i: problem.candidates[i].identifiers for i in model.members}
    sizes = {i: trace(names) for i, names in effects.items()}
    total = trace([t.effect.identifier for t in terms])
    shifting = [i for i, names in effects.items() if effect_of(names[0]).shifts_commands]
    lesser = sorted(shifting, key=lambda i: sizes[i])[:-1]
    faint = [i for i in model.members if sizes[i] < NEGLIGIBLE * total or i in lesser]
    dropped = dict.fromkeys(
        [tuple(faint), tuple(shifting if lesser else []), *((i,) for i in faint)]
    )
    kept = [tuple(i for i in model.members if i not in gone) for gone in dropped if gone]
    return [Model(members, problem.score(members)) for members in kept if members]


def score_of(fit: Fit, priors: Priors) -> float:
    """Return the log evidence with priors of effects and onsets."""
    return fit.log_evidence + prior_of(names_of_fit(fit), priors) + fit.onset_prior


def _distinct(problem: RegressionProblem, models: Sequence[Model]) -> list[Model]:
    """The best variant of each set of effects."""
    kept: dict[tuple[str, ...], Model] = {}
    for m in models:
        kept.setdefault(names_of(problem, m), m)
    return list(kept.values())


def names_of(problem: RegressionProblem, model: Model) -> tuple[str, ...]:
    """Return the identifiers of a model, sorted."""
    return tuple(sorted(name for i in model.members for name in problem.candidates[i].identifiers))


def names_of_fit(fit: Fit) -> tuple[str, ...]:
    """Return the identifiers of a fit, sorted."""
    return tuple(sorted(t.effect.identifier for t in fit.terms))
