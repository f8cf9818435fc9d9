"""Start of a search: flights without shocks, candidates, and the noise if all candidates help."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.numerics import NoiseModel, fit_noise, no_worse, scale_only, with_loudness
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import (
    Candidate,
    RegressionProblem,
    calibration,
    library_candidates,
    sensor_drift,
    wind_candidates,
)
from np_drake.diagnosis.residuals import FORCE, FlightResiduals, find_shocks
from np_drake.diagnosis.selection.onset_candidates import new_conditions, switched_candidates
from np_drake.diagnosis.selection.payload_search import PayloadSearch


@dc.dataclass(frozen=True)
class Ready:
    """Flights with their shocks known, raw channels without them, nuisance columns, candidates and noise."""

    flights: list[FlightResiduals]
    raw: list[np.ndarray]
    nuisance: list[Candidate]
    candidates: list[Candidate]
    noise: NoiseModel


def prepare(flights: Sequence[FlightResiduals], options: Options, *, calm: bool = False) -> Ready:
    """Return shocks, payloads and noise as they show when every effect helps.

    calm: whether no wind acts in all flights; one that begins, or that some lack, is tried all the same.
    """
    tolerance, error = options.tolerance, options.priors.linear_error
    drifting = sensor_drift(flights, tolerance)
    nuisance = [*calibration(flights, tolerance), *([drifting] if drifting else [])]
    plain = library_candidates(flights)
    candidates = [*plain, *([] if calm else wind_candidates(flights, plain))]
    step = flights[0].grid.step
    white = scale_only([e.y for e in flights], step)
    problem = RegressionProblem(
        flights, white, nuisance, candidates, temperature=options.priors.temperature, options=options
    )
    everything = [*candidates, *switched_candidates(problem), *new_conditions(problem)]
    residual = _rich_residuals(
        RegressionProblem(flights, white, nuisance, everything, temperature=1.0, options=options)
    )
    flights = [
        dc.replace(e, shocks=e.shocks | find_shocks(r, step)) for e, r in zip(flights, residual, strict=True)
    ]
    raw = [e.bridged(e.y) for e in flights]
    white = scale_only(raw, step)
    if any(e.shocks.any() for e in flights):
        residual = _rich_residuals(
            RegressionProblem(flights, white, nuisance, everything, temperature=1.0, options=options)
        )
    noise = noise_of(flights, residual, raw, options, error)
    others = [
        plain[i]
        for i in _best_variants(
            RegressionProblem(flights, noise, [], plain, temperature=1.0, options=options)
        )
    ]
    residual = _rich_residuals(
        RegressionProblem(flights, white, nuisance, others, temperature=1.0, options=options)
    )
    weights = (white, scale_only(no_worse(residual, raw), step))  # a light payload shows in the second alone
    payloads = next(
        filter(None, (PayloadSearch(flights, options).best(n, nuisance, others) for n in weights)), []
    )
    # A swing that is not fitted yet is a resonance of the noise, which would hide it: white weights do not.
    first = weights[1] if payloads else noise
    residual = _rich_residuals(
        RegressionProblem(
            flights, first, nuisance, [*everything, *payloads], temperature=1.0, options=options
        )
    )
    noise = noise_of(flights, residual, raw, options, error)
    return Ready(list(flights), raw, nuisance, [*candidates, *payloads], noise)


def noise_of(
    flights: Sequence[FlightResiduals], residuals, raw, options: Options, inexact: float = 0.0
) -> NoiseModel:
    """Return the noise that residuals show, with what errors of the regressors add to it.

    A force is known in body axes as well as the attitude is: slow, as real sensors drift.
    Thrust from rotor speed is known as well as that is read.

    Args:
        residuals, raw: (m, 15) by flight, after and before a model.
        inexact: share of what the model explains that it gets wrong [1]; `linear_error` for linear columns.
    """
    residuals = [e.known(r) for e, r in zip(flights, residuals, strict=True)]
    explained = [y - r for y, r in zip(raw, residuals, strict=True)]
    force = np.sqrt(np.mean(np.sum(np.concatenate(explained)[:, FORCE] ** 2, axis=1)))
    slow = np.zeros(raw[0].shape[1])
    slow[FORCE] = options.tolerance.attitude * force
    white = np.sqrt(np.mean([e.rotor_noise**2 for e in flights], axis=0))
    step = flights[0].grid.step
    left = no_worse(residuals, raw)
    noise = fit_noise(left, step, explained=explained, inexact=inexact, slow=slow, white=white)
    if not flights[0].measured_rotors:
        return noise
    return with_loudness(noise, [r - r.mean(axis=0) for r in left], [e.name for e in flights])


def _best_variants(problem: RegressionProblem) -> list[int]:
    """Of every effect the variant that explains most alone: its position."""
    best: dict[tuple[str, ...], tuple[float, int]] = {}
    for i, c in enumerate(problem.candidates):
        gain = problem.total.log_evidence(problem.columns_of(i))
        if c.identifiers not in best or gain > best[c.identifiers][0]:
            best[c.identifiers] = (gain, i)
    return [i for _, i in best.values()]


def _rich_residuals(problem: RegressionProblem) -> list[np.ndarray]:
    """What is left of the channels when every effect helps, each in its best single variant."""
    chosen = _best_variants(problem)
    mean, _ = problem.total.posterior(problem.columns(chosen))
    columns = [*problem.nuisance, *(problem.candidates[i] for i in chosen)]
    parts = np.split(mean, np.cumsum([c.size for c in columns])[:-1])
    return [
        e.known(
            e.bridged(e.y - sum(c.columns[e.name] @ part for c, part in zip(columns, parts, strict=True)))
        )
        for e in problem.flights
    ]
