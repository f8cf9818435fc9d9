"""Share of the rotors' torque to which the motion responds: calibration that comes before
everything else.

Controllers run faster than logs: of logged torque the motion may show a small part. J dw/dt = gain
(torque of rotors and effects) holds for both. Torque that trims a moment of the air or of a payload
does not count: effects explain it.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals
from np_drake.rigid_body import V

LAGS = (0.0, 0.04, 0.08)  # at which motion may answer torque, as rotors do [s]
CHANGE = 0.1  # over which torque changes; own choice: faster than a trim, slower than noise [s]
LEAST = 0.02  # so that calibration still has a torque to scale [1]


def torque_gain(flights: Sequence[FlightResiduals]) -> np.ndarray:
    """Return (3,) the share of the rotors' torque about each axis to which the motion of all
    flights responds [1].

    It is the RMS of the change of the motion's torque that lagged rotor torque predicts, over that
    of rotor torque.
    Source: least squares, whose gain is the conditional mean given a noisy regressor, beside
        moments of air and load.
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
    """Return rotor torque about an axis at all lags (m, k), and the torque of the motion (m,)
    [N·m].

    Both as changes, and without what goes with the changes of velocity, thrust and residual force.
    """
    torque = e.nominal[:, TORQUE][:, axis]
    v_B = e.from_mids(attitude.rotate_back(e.mids.q, e.wrench_states[1][:, V]))
    rows = [round(lag / e.grid.step) for lag in LAGS]
    lagged = [torque[rows[-1] - k : len(torque) - k] for k in rows]
    others = (torque + e.y[:, TORQUE][:, axis], v_B, e.nominal[:, 2], e.y[:, FORCE])
    signals = np.column_stack([*lagged, *(signal[rows[-1] :] for signal in others)])
    apart = max(1, round(CHANGE / e.grid.step))
    change = signals[apart:] - signals[:-apart]
    own, beside = np.split(change, [len(LAGS) + 1], axis=1)
    own = own - beside @ np.linalg.lstsq(beside, own, rcond=None)[0]
    return own[:, :-1], own[:, -1]


def with_torque_gain(flights: Sequence[FlightResiduals], gain: np.ndarray) -> list[FlightResiduals]:
    """Return flights whose motion shows that share of all torque: that of the rotors, and that of
    any effect.

    Args:
        gain: (3,) by `torque_gain` [1].
    """
    found = []
    for e in flights:
        scaled = dc.replace(e, torque_gain=tuple(gain.tolist()))
        y, nominal = e.y.copy(), e.nominal * scaled.shown
        y[:, WRENCH] += e.nominal - nominal
        found.append(dc.replace(scaled, y=e.known(y), nominal=nominal))
    return found
