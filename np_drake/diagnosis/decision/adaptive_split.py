"""Adaptive split: first halves of held-out flights join the fit where they show what training flights do not excite.

The second halves alone judge then.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence

import numpy as np

from np_drake.diagnosis.adequacy import gust_probability, novel_on_held_out, swing_free_residual
from np_drake.diagnosis.decision.compare import Comparison, compare
from np_drake.diagnosis.decision.decide import Inference, decide
from np_drake.diagnosis.held_out import HeldOut, misfit, on_held_out, without_shocks
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Options, Thresholds
from np_drake.diagnosis.residuals import FlightResiduals, make_flight_residuals
from np_drake.diagnosis.result import Cause
from np_drake.diagnosis.selection import PAYLOAD, SearchResult, find_map_model, probabilities
from np_drake.diagnosis.wind import slow_power

NAME = "first half of {}"
JOINED = "shows what the training flights do not; its first half joined the fit, its second half judges."


@dc.dataclass(frozen=True)
class _SplitNeeded:
    """What the second inference takes over from the first: the probability of a payload [1], and the options."""

    payload: float
    options: Options


def infer_adaptively(
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    options: Options | None,
    on_progress: Callable[[float, str], None],
) -> tuple[Inference, list[FlightResiduals]]:
    """Return the inference, adaptively split where held-out flights need it, and the halves that joined the fit.

    Where the best model plainly shows that a split is needed, it is not compared with its rivals before.
    """
    first = _first_inference(flights, held_out, options)
    if isinstance(first, Inference):
        return first, []
    thresholds = first.options.thresholds
    on_progress(0.4, "what held-out flights show")
    joined, judges = split_flights(held_out, thresholds.split_half)
    hanging = first.payload > thresholds.split_payload
    return decide(compare(find_map_model([*flights, *joined], options, hanging=hanging), judges)), joined


def _first_inference(
    flights: Sequence[FlightResiduals], held_out: Sequence[FlightResiduals], options: Options | None
) -> "Inference | _SplitNeeded":
    """Return the first inference if it is enough, else what the second takes over: the rest would take its memory."""
    found = find_map_model(flights, options)
    if not any(_middle(e) - e.log.t[0] >= found.options.thresholds.split_half for e in held_out):
        return decide(compare(found, held_out))
    if plainly_needs_split(found, held_out):
        payload = probabilities(found.problem, found.models, [found.best]).get(PAYLOAD, 0.0)
        return _SplitNeeded(payload, found.options)
    first = compare(found, held_out)
    if not needs_split(first):
        return decide(first)
    return _SplitNeeded(first.ranking.probability.get(PAYLOAD, 0.0), first.ranking.options)


def needs_split(first: Comparison) -> bool:
    """Return whether held-out flights show more than noise, or a force or torque that training flights do not excite.

    Gusts, which repeat nowhere, and a payload, whose swing may be lost, do not count.
    """
    if first.gusty or any(t.swings for t in first.ranking.named.terms):
        return False
    return first.unexplained.novel_on_held_out or _more_than_noise(
        first.unexplained.held, first.ranking.noise, first.ranking.options.thresholds
    )


def plainly_needs_split(found: SearchResult, held_out: Sequence[FlightResiduals]) -> bool:
    """Return whether the best model needs a split, before it is compared with its rivals.

    Only models with generic structure and without a payload do. Held-out evidence of rivals is skipped then
    (`rerank_by_held_out_evidence`), and a slow force counts as part of that structure, not as gusts.
    """
    best, noise, options, flights = found.best, found.noise, found.options, found.problem.flights
    if not best.generic or any(t.swings for t in best.terms):
        return False
    held_out = [without_shocks(best.everything, e, noise, options.priors) for e in held_out]
    held = on_held_out(best, held_out, noise, options.priors, structured=flights[0].measured_rotors)
    if _more_than_noise(held, noise, options.thresholds):
        return True
    residual = {e.name: best.residual(e) for e in flights}
    swung = {e.name: swing_free_residual(held, e) for e in held_out}
    gusty = gust_probability(best, options, flights, residual, held_out, swung) > 0.5
    return novel_on_held_out(held_out, swung, options, slow_power(flights, residual), gusty=gusty)[0] > 0.5


def _more_than_noise(held: HeldOut, noise: NoiseModel, thresholds: Thresholds) -> bool:
    return bool(misfit(held, noise).max() > thresholds.split_misfit)


def _middle(e: FlightResiduals) -> float:
    return 0.5 * (e.log.t[0] + e.log.t[-1])


def split_flights(
    flights: Sequence[FlightResiduals], least: float
) -> tuple[list[FlightResiduals], list[FlightResiduals]]:
    """Return the first halves of flights as flights of their own, and all flights with these rows marked as joined.

    least: duration of either half; shorter flights stay whole [s].
    """
    halves, judges = [], []
    for e in flights:
        log = e.log
        middle = _middle(e)
        if middle - log.t[0] < least:
            judges.append(e)
            continue
        half = dc.replace(log.rows(0, int(np.searchsorted(log.t, middle))), name=NAME.format(e.name))
        halves.append(dc.replace(make_flight_residuals(half, e.vehicle, e.grid.step), goes_on=True))
        judges.append(dc.replace(e, joined=e.t <= middle))
    return halves, judges


def without_onsets_in(flights: Sequence[FlightResiduals], cause: Cause) -> Cause:
    """Return the cause without its onsets in these flights, which are parts of others."""
    names = {e.name for e in flights}
    return dc.replace(cause, onset={n: t for n, t in cause.onset.items() if n not in names})
