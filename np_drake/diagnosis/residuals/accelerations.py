"""States at the instants at which force and torque are measured, with smoothed accelerations as regressors."""

import dataclasses as dc
from functools import cached_property

import numpy as np
from scipy import signal

from np_drake import attitude
from np_drake.diagnosis.residuals.path_smoothing import corrected_acceleration
from np_drake.logs.flight_log import FlightLog
from np_drake.rigid_body import P, Q, W

REGRESSOR_BAND = 8.0  # low-pass on accelerations that enter as regressors [Hz]; own choice


@dc.dataclass(frozen=True)
class Instants:
    """States at some instants of a flight: t (n,), x (n, 13); smoothed, as regressors, a (n, 3) in W and al (n, 3)."""

    t: np.ndarray
    x: np.ndarray
    a: np.ndarray
    al: np.ndarray

    @property
    def q(self) -> np.ndarray:
        """(n, 4) attitude."""
        return self.x[:, Q]

    @cached_property
    def R_WB(self) -> np.ndarray:
        """(n, 3, 3) the same as rotation matrices."""
        return attitude.rotation_matrix(self.q)

    @cached_property
    def lever(self) -> np.ndarray:
        """(n, 3, 3) times a body-fixed point p_BoP_B [m]: by how much it accelerates more than Bo, in W [1/s²]."""
        turning = attitude.skew(self.x[:, W])
        return self.R_WB @ (attitude.skew(self.al) + turning @ turning)


def make_instants(log: FlightLog, smooth: np.ndarray) -> tuple[Instants, Instants]:
    """Rows and the middles between them, with smoothed attitudes (n, 4); without accelerations both are the middles."""
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
    """(n, m) zero-phase second-order low-pass [Hz]; as it is where the band is beyond the rate."""
    if band >= 0.45 / step or len(values) < 20:
        return values
    sos = signal.butter(2, band * 2 * step, output="sos")
    return signal.sosfiltfilt(sos, values, axis=0, padlen=min(len(values) - 1, int(2 / (band * step))))
