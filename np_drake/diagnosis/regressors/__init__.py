"""Regressors of the linear model: library effects, generic structure, nuisance parameters."""

from np_drake.diagnosis.regressors.generic import PREFIX, generic_candidates
from np_drake.diagnosis.regressors.library_regressors import (
    DRAG,
    GUSTY,
    LINEAR,
    PAYLOAD,
    WIND,
    Candidate,
    Onset,
    at_value,
    hidden_from,
    library_candidates,
    options_of,
    switched,
    tolerance_of,
    widen_tolerance,
    wind_candidates,
)
from np_drake.diagnosis.regressors.regression_problem import (
    Model,
    RegressionProblem,
    Sums,
    SwitchedRegressors,
    WhiteNuisance,
    onset_log_likelihood,
    ordered_changes,
    prior_of,
    times_of_changes,
)
