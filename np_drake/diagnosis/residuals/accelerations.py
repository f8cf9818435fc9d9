"""States at the instants at which force and torque are measured, with smoothed accelerations as regressors."""

import dataclasses as dc
from functools import cached_property

import numpy as np
from scipy import signal

from np_drake import attitude
from np_drake.diagnosis.residuals.path_smoothing import corrected_acceleration
from np_drake.flight_log import FlightLog
from np_drake.rigid_body import P, Q, W

REGRESSOR_BAND = 8.0  # low-pass on accelerations that enter as regressors [Hz]; own choice


@dc.dataclass(frozen=True)
class Instants:
    """States of a flight at the instants t (n,) [s]: x (n, 13) of Bo.

    a (n, 3) in W [m/s²] and al (n, 3) in B [rad/s²] are smoothed accelerations, for use as regressors.
    """

    t: np.ndarray
    x: np.ndarray
    a: np.ndarray
    al: np.ndarray

    @property
    def q(self) -> np.ndarray:
        """(n, 4) attitude quaternion (w, x, y, z)."""
        return self.x[:, Q]

    @cached_property
    def R_WB(self) -> np.ndarray:
        """(n, 3, 3) attitude as rotation matrices."""
        return attitude.rotation_matrix(self.q)

    @cached_property
    def sweep(self) -> np.ndarray:
        """(n, 3, 3) matrix that maps p_BoP_B [m] to the velocity of P relative to Bo, in W [1/s]."""
        return self.R_WB @ attitude.skew(self.x[:, W])

    @cached_property
    def lever(self) -> np.ndarray:
        """(n, 3, 3) matrix that maps p_BoP_B [m] to the acceleration of P relative to Bo, in W [1/s²]."""
        turning = attitude.skew(self.x[:, W])
        return self.R_WB @ (attitude.skew(self.al) + turning @ turning)


def make_instants(log: FlightLog, smooth: np.ndarray) -> tuple[Instants, Instants]:
    """Return the states at the rows of a log and at the middles between them.

    Without logged accelerations both are the middles.

    Args:
        log: the flight.
        smooth: (n, 4) smoothed attitude at the rows.
    """
    dt, step = np.diff(log.t)[:, None], log.step
    t_mid = 0.5 * (log.t[1:] + log.t[:-1])
    al = low_pass(np.diff(log.w, axis=0) / dt, step, REGRESSOR_BAND)
    al_rows = np.stack([np.interp(log.t, t_mid, al[:, i]) for i in range(3)], axis=1)
    x = np.concatenate([log.p, smooth, log.v, log.w], axis=1)
    x_mid = 0.5 * (x[1:] + x[:-1])
    x_mid[:, Q] /= np.linalg.norm(x_mid[:, Q], axis=1, keepdims=True)
    if log.a is None:
        rate = np.diff(log.v, axis=0) / dt
        a = low_pass(corrected_acceleration(t_mid, x_mid[:, P], rate), step, REGRESSOR_BAND)
        mids = Instants(t_mid, x_mid, a, al)
        return mids, mids
    a = low_pass(corrected_acceleration(log.t, log.p, log.a), step, REGRESSOR_BAND)
    return Instants(log.t, x, a, al_rows), Instants(t_mid, x_mid, a[:-1], al)


def low_pass(values: np.ndarray, step: float, band: float) -> np.ndarray:
    """Apply a zero-phase second-order Butterworth low-pass to each column.

    Args:
        values: (n, m) samples.
        step: sample interval [s].
        band: cut-off frequency [Hz].
    Returns: (n, m) filtered samples; `values` unchanged where the band reaches the sampling limit or rows are fewer
        than 20.
    """
    if band >= 0.45 / step or len(values) < 20:
        return values
    sos = signal.butter(2, band * 2 * step, output="sos")
    return signal.sosfiltfilt(sos, values, axis=0, padlen=min(len(values) - 1, int(2 / (band * step))))
