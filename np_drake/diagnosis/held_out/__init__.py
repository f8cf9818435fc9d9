"""Models on flights to which they were not fitted."""

from np_drake.diagnosis.held_out.adaptation import (
    adapt,
    onset_log_likelihood,
    scored_on_fitted_rows,
    without_shocks,
)
from np_drake.diagnosis.held_out.prediction import HeldOut, misfit, on_held_out, pooled, remaining_residual

__all__ = [
    "HeldOut",
    "adapt",
    "misfit",
    "on_held_out",
    "onset_log_likelihood",
    "pooled",
    "remaining_residual",
    "scored_on_fitted_rows",
    "without_shocks",
]
