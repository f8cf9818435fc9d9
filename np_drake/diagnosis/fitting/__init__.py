"""Maximum a posteriori fit of one model's parameters, with starts, bounds and hidden states."""

from np_drake.diagnosis.fitting.isotropic_prior import with_isotropic_prior
from np_drake.diagnosis.fitting.map_estimate import Fit, Generic
from np_drake.diagnosis.fitting.multi_start import first_fit, refit, restarted
from np_drake.diagnosis.fitting.physical_bounds import impossible, interval
from np_drake.diagnosis.fitting.resonance_fit import mode_of
from np_drake.diagnosis.fitting.swing_fit import SwingFit, fitted_to_whole_flight

__all__ = [
    "Fit",
    "Generic",
    "SwingFit",
    "first_fit",
    "fitted_to_whole_flight",
    "impossible",
    "interval",
    "mode_of",
    "refit",
    "restarted",
    "with_isotropic_prior",
]
