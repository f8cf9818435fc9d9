"""What generic structure may depend on: the state of a flight on its grid."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.residuals.flight_residuals import FlightResiduals

SURELY = 4.0  # times the noise that an axis must move to be a regressor at all; own choice


@dc.dataclass(frozen=True)
class FlightState:
    """On the grid: v, w (m, 3) in B [m/s, rad/s], p (m, 3) in W [m], R (m, 3, 3), u (m, 4) nominal [f, tau],

    rotor (m, 4) nominal thrusts [N], t (m,) [s]; mixer (4, 4); torque_unit (3,): arms of the prior [m]; weight [N];
    gravity [m/s²]; step [s].
    """

    v: np.ndarray
    p: np.ndarray
    w: np.ndarray
    R: np.ndarray
    u: np.ndarray
    rotor: np.ndarray
    t: np.ndarray
    mixer: np.ndarray
    torque_unit: np.ndarray
    weight: float
    gravity: float
    step: float


def flight_state(flight: FlightResiduals) -> FlightState:
    """Of one flight."""
    mids, vehicle, log = flight.mids, flight.vehicle, flight.log
    u = flight.nominal[:, 2:]
    arm = float(np.mean(np.linalg.norm(np.array(vehicle.rotor_positions), axis=1)))
    return FlightState(
        v=_above_noise(flight.from_mids(attitude.rotate_back(mids.q, mids.x[:, 7:10])), log.v),
        p=flight.from_mids(mids.x[:, :3]),
        w=_above_noise(flight.w, log.w),
        R=flight.from_mids(attitude.rotation_matrix(mids.q)),
        u=u,
        rotor=u @ vehicle.unmixer.T,
        t=flight.t,
        mixer=vehicle.mixer,
        torque_unit=arm * np.array([0.3, 0.3, 0.1]),
        weight=vehicle.mass * vehicle.gravity,
        gravity=vehicle.gravity,
        step=flight.grid.step,
    )


def _above_noise(values: np.ndarray, read: np.ndarray) -> np.ndarray:
    """values (m, 3), each axis shrunk by its share of signal (Wiener), with the white noise that `read` (n, 3) shows.

    An axis that hardly moves is noise, which its derivative shares: torque would seem to go with it.
    The noise of three axes together, for v is turned from W to B.   Source: own choice: `SURELY`.
    """
    noise = np.mean(np.diff(read, n=2, axis=0) ** 2) / 6.0  # of second differences of white noise
    return values * np.clip(1 - SURELY * noise / np.maximum(values.var(axis=0), 1e-12), 0.0, 1.0)
