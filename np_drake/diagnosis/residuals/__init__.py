"""Residuals of flight logs against the nominal model, on a uniform grid."""

from np_drake.diagnosis.residuals.accelerations import Instants, low_pass
from np_drake.diagnosis.residuals.attitude_smoothing import QUIET, smooth_attitude
from np_drake.diagnosis.residuals.flight_residuals import (
    FORCE,
    POSITION,
    SIZE,
    TORQUE,
    VELOCITY,
    WRENCH,
    FlightResiduals,
)
from np_drake.diagnosis.residuals.make_flight_residuals import (
    LEAST_DURATION,
    long_enough,
    make_flight_residuals,
    require_flights,
    with_same_readings,
)
from np_drake.diagnosis.residuals.outliers import (
    LONGEST_BOUNCE,
    LONGEST_OUTLIER,
    MOST_OUTLIERS,
    OUTLIERS_APART,
    bridge,
    find_outliers,
)
from np_drake.diagnosis.residuals.resampling import Resampler, natural_step
