"""Judgement of one term of the best model: how probable it is, and how probably material."""

import dataclasses as dc
from collections.abc import Sequence

from scipy import special

from np_drake.diagnosis.adequacy.linear_model import LinearModel
from np_drake.diagnosis.decision.effect_size import (
    material_share,
    relative_sizes,
    size_of,
    wind_share,
    within_calibration,
)
from np_drake.diagnosis.fitting import impossible
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import Size
from np_drake.diagnosis.regressors import DRAG
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.selection import Ranking


@dc.dataclass(frozen=True)
class Judged:
    """What is known of a term of the best model.

    in_model: probability that it acts, against other effects and generic structure in its place [1].
    material: probability that it is larger than what is practically none, given that it acts [1].
    size: at the fit.   stands_for: why its parameters are not physical; empty where they are.
    """

    in_model: float
    material: float
    size: Size
    stands_for: str

    @property
    def probability(self) -> float:
        """Probability of a cause [1]."""
        return 0.0 if self.stands_for else self.in_model * self.material

    @property
    def reason(self) -> str:
        """Why it is a minor finding."""
        if self.stands_for:
            return self.stands_for
        return "immaterial" if self.material < self.in_model else f"not sure, {self.in_model:.2g}"


def judge(
    ranking: Ranking,
    linear: LinearModel,
    structure: Sequence[int],
    i: int,
    same: Sequence[str],
    held_out: Sequence[FlightResiduals],
    held: HeldOut,
    *,
    gusty: bool = False,
) -> Judged:
    """Judge term i of the best model.

    Args:
        ranking, linear, structure, held_out, held: as in `causes_of`.
        same: effects that cannot be told from term i, whose probability is added.
        gusty: gusts blow. The drag that feels them is material and stands for nothing else; its prior is that of gusts
            against structure that is no effect.
    """
    fit, flights, options = ranking.best, ranking.problem.flights, ranking.options
    effect, tolerance = fit.terms[i].effect, options.tolerance
    named = min(1.0, sum(ranking.probability.get(name, 0.0) for name in (effect.identifier, *same)))
    blown, priors = gusty and effect.identifier == DRAG, options.priors
    brought = priors.generic - priors.of_effect(DRAG) if blown else 0.0
    in_model = named * float(special.expit(linear.margin(i, structure) + brought))
    size = size_of(fit, i, flights, ranking.noise, tolerance, [(e, held.terms[e.name]) for e in held_out])
    material = material_share(
        size,
        relative_sizes(fit, i, flights),
        options.materiality,
        calibration=within_calibration(fit.terms[i], options),
        sensor=tolerance.of(effect) > 0,
    )
    materiality = options.materiality
    material *= wind_share(fit, i, flights, materiality.still_air, materiality.sensor * tolerance.lean)
    shift = abs(effect.time_shift(flights[0].vehicle))
    if 0 < shift < materiality.sensor * tolerance.timing:
        material = 0.0
    if blown:
        return Judged(in_model, 1.0, size, "")
    return Judged(in_model, material, size, impossible(fit, i, flights[0].vehicle))
