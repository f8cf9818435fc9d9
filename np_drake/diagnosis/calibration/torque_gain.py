"""Share of the rotors' torque to which the motion responds: calibration that comes before everything else.

Controllers run faster than logs: of logged torque the motion may show a small part. J dw/dt = gain (torque of rotors and
effects) holds for both. Slow torque does not count: it trims moments of air and payload, which effects are to explain.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.residuals import TORQUE, WRENCH, FlightResiduals

LAGS = (0.0, 0.04, 0.08)  # at which motion may answer torque, as rotors do [s]
CHANGE = 0.1  # over which torque changes; own choice: faster than a trim, slower than noise [s]
LEAST = 0.02  # so that calibration still has a torque to scale [1]


def torque_gain(flights: Sequence[FlightResiduals]) -> np.ndarray:
    """Return (3,) the share of the rotors' torque about each axis to which the motion of all flights responds [1].

    It is the RMS of the change of the motion's torque that lagged rotor torque predicts, over that of rotor torque.
    Source: least squares, whose gain is the conditional mean given a noisy regressor.
    """
    gain = np.ones(3)
    for axis in range(3):
        given, shown = zip(*(_lagged(e, axis) for e in flights), strict=True)
        X, y = np.concatenate(given), np.concatenate(shown)
        rms = np.sqrt(np.mean(X[:, 0] ** 2))
        if rms > 0:
            answer = X @ np.linalg.lstsq(X, y, rcond=None)[0]
            gain[axis] = np.clip(np.sqrt(np.mean(answer**2)) / rms, LEAST, 1.0)
    return gain


def _lagged(e: FlightResiduals, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Return rotor torque about an axis at all lags (m, k), and the torque of the motion (m,), as changes [N·m]."""
    torque = e.nominal[:, TORQUE][:, axis]
    shown = torque + e.y[:, TORQUE][:, axis]
    rows = [round(lag / e.grid.step) for lag in LAGS]
    X = np.stack([torque[rows[-1] - k : len(torque) - k] for k in rows], axis=1)
    y = shown[rows[-1] :]
    apart = max(1, round(CHANGE / e.grid.step))
    return X[apart:] - X[:-apart], y[apart:] - y[:-apart]


def with_torque_gain(flights: Sequence[FlightResiduals], gain: np.ndarray) -> list[FlightResiduals]:
    """Return flights whose motion shows that share of all torque: that of the rotors, and that of any effect.

    Args:
        flights: as logged.
        gain: (3,) by `torque_gain` [1].
    """
    found = []
    for e in flights:
        scaled = dc.replace(e, torque_gain=tuple(gain.tolist()))
        y, nominal = e.y.copy(), e.nominal * scaled.shown
        y[:, WRENCH] += e.nominal - nominal
        found.append(dc.replace(scaled, y=e.known(y), nominal=nominal))
    return found
