"""A slow force that comes and goes, explained by gusts through the drag that was found."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.adequacy import Unexplained
from np_drake.diagnosis.decision.compare import Comparison, residual_beside_named
from np_drake.diagnosis.decision.confidence import largest_misfit
from np_drake.diagnosis.forward_model import predicted_residual
from np_drake.diagnosis.regressors import DRAG, GUSTY
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause, Finding
from np_drake.diagnosis.selection import Ranking
from np_drake.diagnosis.wind import as_gusts, in_gusts

UPRIGHT = Finding(
    "upright", "a force along the thrust or a torque, which gusts, being level, do not have", 1.0, {}
)


def explain_by_gusts(
    compared: Comparison, unexplained: Unexplained, causes: list[Cause]
) -> tuple[list[Cause], Unexplained, bool, float]:
    """Return the causes with gusts among them, what they leave unexplained, whether that is material, and how probably.

    It stays unknown where no drag was found that would feel gusts, or where lift or torque, which level gusts do not
    have, is left on held-out flights.
    """
    flights, held_out, ranking = compared.flights, compared.held_out, compared.ranking
    thresholds = ranking.options.thresholds
    blows = thresholds.trust * unexplained.slow_probability * ranking.probability.get(DRAG, 1.0)
    felt = _felt(ranking, unexplained, flights, held_out)
    causes = as_gusts(flights, felt, causes, blows, ranking.options, held_out)
    if not any(c.identifier == "gusty_wind" for c in causes):
        return causes, unexplained, True, unexplained.slow_probability
    unexplained = dc.replace(unexplained, held=in_gusts(unexplained.held, causes, held_out))
    if largest_misfit(ranking, unexplained, gusty=True) <= thresholds.upright:
        return causes, unexplained, False, unexplained.probability
    unexplained = dc.replace(unexplained, findings=(*unexplained.findings, UPRIGHT))
    return causes, unexplained, True, unexplained.slow_probability


def _felt(
    ranking: Ranking,
    unexplained: Unexplained,
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
) -> dict[str, np.ndarray]:
    """Return by flight the residual (m, 15) with the predicted residual of drag and wind added back."""
    rest = residual_beside_named(ranking, unexplained, flights, held_out)
    blown = {
        e.name: [
            t for t in unexplained.held.terms.get(e.name, ranking.named.terms) if t.effect.identifier in GUSTY
        ]
        for e in (*flights, *held_out)
    }
    return {e.name: rest[e.name] + predicted_residual(e, blown[e.name]) for e in (*flights, *held_out)}
