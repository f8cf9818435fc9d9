"""Inference from one set of training flights and one set of held-out flights."""

from collections.abc import Sequence

from np_drake.diagnosis.decision.compare import compare
from np_drake.diagnosis.decision.decide import Inference, decide
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.selection import find_map_model


def infer(
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    options: Options | None = None,
) -> Inference:
    """Rank the effects by training flights, and decide by held-out flights which of them are causes."""
    return decide(compare(find_map_model(flights, options), held_out))
