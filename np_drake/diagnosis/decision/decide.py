"""Decision which effects are causes, and whether something unknown acts."""

import dataclasses as dc

from np_drake.diagnosis.adequacy import with_fitted_resonances
from np_drake.diagnosis.decision.cause_report import PROBABILITY
from np_drake.diagnosis.decision.causes import causes_of
from np_drake.diagnosis.decision.compare import Comparison, has_slow_force
from np_drake.diagnosis.decision.confidence import is_vague_drift, leaves_more_than_noise, structure_instead
from np_drake.diagnosis.decision.consistency import without_superfluous
from np_drake.diagnosis.decision.gust_causes import explain_by_gusts
from np_drake.diagnosis.result import Cause, Finding


@dc.dataclass(frozen=True)
class Inference(Comparison):
    """A comparison with the causes that follow from it."""

    causes: list[Cause]
    minor: list[Finding]
    unknown: bool
    unknown_probability: float


def decide(compared: Comparison) -> Inference:
    """Return the causes that a comparison shows, and whether there is one that is unknown."""
    flights, held_out, ranking, gusty = compared.flights, compared.held_out, compared.ranking, compared.gusty
    thresholds = ranking.options.thresholds
    unexplained = with_fitted_resonances(compared.unexplained, ranking)
    unknown, probability = unexplained.unknown, unexplained.probability
    causes, minor = causes_of(ranking, ranking.named, flights, held_out, unexplained.held, gusty=gusty)
    if has_slow_force(unexplained) and not gusty:
        unknown, probability = True, unexplained.slow_probability
    elif not (unknown or gusty or causes) and any(PROBABILITY in f.figures for f in minor):
        unknown, probability, unexplained = structure_instead(ranking, unexplained)
    if gusty:
        causes, unexplained, unknown, probability = explain_by_gusts(compared, unexplained, causes)
    if unknown:
        causes, idle = without_superfluous(causes, held_out, ranking.noise, unexplained.held)
        causes = [dc.replace(c, probability=min(c.probability, thresholds.beside_unknown)) for c in causes]
        minor = [*minor, *idle]
    else:
        doubted = thresholds.doubted
        all_of_them = doubted if leaves_more_than_noise(ranking, unexplained, gusty=gusty) else 1.0
        most = [min(all_of_them, doubted if is_vague_drift(c, ranking.options) else 1.0) for c in causes]
        causes = [dc.replace(c, probability=min(c.probability, p)) for c, p in zip(causes, most, strict=True)]
    return Inference(flights, held_out, ranking, unexplained, gusty, causes, minor, unknown, probability)
