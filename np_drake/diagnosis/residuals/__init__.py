"""Residuals of flight logs against the nominal model, on a uniform grid."""

from np_drake.diagnosis.residuals.flight_residuals import (
    FORCE,
    LEAST_DURATION,
    POSITION,
    SIZE,
    TORQUE,
    VELOCITY,
    WRENCH,
    FlightResiduals,
    long_enough,
    make_flight_residuals,
    require_alike,
    require_flights,
    with_same_readings,
)
from np_drake.diagnosis.residuals.resampling import (
    LONGEST_BOUNCE,
    LONGEST_OUTLIER,
    MOST_OUTLIERS,
    OUTLIERS_APART,
    Resampler,
    bridge,
    common_step,
    find_outliers,
)
from np_drake.diagnosis.residuals.smoothing import QUIET, Instants, low_pass, smooth_attitude
