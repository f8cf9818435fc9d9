"""Models on flights to which they were not fitted."""

from np_drake.diagnosis.held_out.adaptation import mark_outliers, scored_on_fitted_rows
from np_drake.diagnosis.held_out.prediction import (
    HeldOut,
    closed_fraction,
    misfit,
    on_held_out,
    pooled,
    remaining_residual,
    with_calibration,
)

__all__ = [
    "HeldOut",
    "closed_fraction",
    "mark_outliers",
    "misfit",
    "on_held_out",
    "pooled",
    "remaining_residual",
    "scored_on_fitted_rows",
    "with_calibration",
]
