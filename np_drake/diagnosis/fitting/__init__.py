"""Maximum a posteriori fit of one model's parameters, with starts, bounds and hidden states."""

from np_drake.diagnosis.fitting.map_estimate import Fit, scaled_jacobian
from np_drake.diagnosis.fitting.multi_start import first_fit, fit_of_some, refit, restart
from np_drake.diagnosis.fitting.parameters import Free, prior_whitening
from np_drake.diagnosis.fitting.physical_bounds import (
    greatest_height,
    impossible,
    interval,
    is_possible,
)
from np_drake.diagnosis.fitting.swing_fit import SwingFit, fitted_to_whole_flight
