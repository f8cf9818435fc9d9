"""Probability of gusts in the residual of all flights."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.fitting import Fit
from np_drake.diagnosis.forward_model import predicted_residual
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.wind import slow_force, slow_power


def swing_free_residual(held: HeldOut, e: FlightResiduals) -> np.ndarray:
    """Return the residual (m, 15) of a held-out flight with a payload's swing fitted to all of it, shocks apart."""
    return e.bridged(e.y - predicted_residual(e, held.whole_flight_terms[e.name]))


def gust_probability(
    named: Fit,
    options: Options,
    flights: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    held_out: Sequence[FlightResiduals],
    swung: dict[str, np.ndarray],
) -> float:
    """Return the probability of a slow force in the air; 0 where training flights show none.

    It must be as large as structure has to be that is no effect.
    """
    seen = slow_force(flights, residual, options)
    both = slow_force([*flights, *held_out], residual | swung, options)
    vehicle, thresholds = flights[0].vehicle, options.thresholds
    matters = both.deviation > options.materiality.force * vehicle.mass * vehicle.gravity
    shown = seen.log_evidence > thresholds.held_out_share * thresholds.slow_force
    lost = any(t.swings for t in named.terms) and slow_power(
        flights, residual
    ) < thresholds.held_out_share * slow_power(flights, {e.name: e.y for e in flights})
    return both.probability(thresholds.slow_force) if matters and shown and not lost else 0.0
