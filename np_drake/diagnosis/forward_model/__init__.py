"""Forward model: the residual that effects with given parameters predict in a flight."""

from np_drake.diagnosis.forward_model.payload_state import (
    MOST_JUMPS,
    NEVER,
    STATE,
    Term,
    hidden_size,
    jumps,
    padded,
    pendulum_error,
    specific_pull,
    swing_units,
    swing_wrenches,
    with_dependants,
)
from np_drake.diagnosis.forward_model.prediction import StageCache, predicted_residual
