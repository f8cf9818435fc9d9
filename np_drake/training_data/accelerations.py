"""Accelerations for a log without them: velocity and body rates differentiated with zero phase."""

import dataclasses as dc

import numpy as np
from scipy import signal

from np_drake.flight_log import FlightLog

BANDWIDTH = 15.0  # [Hz], -6 dB; own choice: 0.3 m/s² of noise from 0.01 m/s at 100 Hz


def with_accelerations(log: FlightLog, bandwidth: float = BANDWIDTH) -> FlightLog:
    """Return the log with a = dv/dt and al = dw/dt where it has none, and a note that says so.

    a_k = zero-phase low-pass of (v_(k+1) - v_k) / (t_(k+1) - t_k): over this interval row k's command acts,
    so the pairing of rows stays (a central difference would mix two commands). It uses the future: results
    one step ahead from such a log are not causal.  Source: own choice.

    Args:   bandwidth: of the low-pass [Hz].
    Raises: ValueError: if the bandwidth is not positive.
    """
    if not bandwidth > 0:
        raise ValueError(f"with_accelerations: bandwidth must be positive [Hz]; got {bandwidth}.")
    new = [name for name in ("a", "al") if getattr(log, name) is None]
    if not new:
        return log
    a = smooth_derivative(log.v, log.t, bandwidth) if log.a is None else log.a
    al = smooth_derivative(log.w, log.t, bandwidth) if log.al is None else log.al
    note = (
        f"{', '.join(new)} differentiated smoothly (zero phase, {bandwidth:g} Hz): they use the future, "
        "figures one step ahead are not causal"
    )
    return dc.replace(log, a=a, al=al, notes=[*log.notes, note])


def smooth_derivative(value: np.ndarray, t: np.ndarray, bandwidth: float) -> np.ndarray:
    """Return the zero-phase derivative of `value` (n, m) over the interval after each row, (n, m).

    Args: t: (n,) [s].   bandwidth: of the low-pass [Hz].
    """
    rate = np.diff(value, axis=0) / np.diff(t)[:, None]
    rate = np.concatenate([rate, rate[-1:]])
    nyquist = 0.5 / float(np.median(np.diff(t)))
    if bandwidth >= nyquist:
        return rate
    sos = signal.butter(2, bandwidth / nyquist, output="sos")
    return signal.sosfiltfilt(sos, rate, axis=0, padlen=min(len(rate) - 1, 15))
