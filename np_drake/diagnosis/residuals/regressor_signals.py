"""Signals on which generic regressors may depend: the state of a flight on its grid."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.residuals.flight_residuals import FlightResiduals
from np_drake.rigid_body import V

LEAST_SIGNAL_TO_NOISE = (
    4.0  # variance of an axis over that of its noise, below which it is no regressor [1]; own choice
)


@dc.dataclass(frozen=True)
class FlightState:
    """State of a flight on its grid.

    v, w (m, 3): velocity and body rates in B [m/s, rad/s]; p (m, 3): position in W [m]; R (m, 3, 3): R_WB.
    u (m, 4): nominal thrust and torques [N, N·m]; rotor (m, 4): nominal rotor thrusts [N]; t (m,): times [s].
    mixer (4, 4): rotor thrusts to u; torque_unit (3,): lever arms that scale torque priors [m].
    weight [N]; gravity [m/s²]; step [s].
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
    """Return the state of one flight on its grid, with noise removed from velocity and body rates."""
    mids, vehicle, log = flight.mids, flight.vehicle, flight.log
    u = flight.nominal[:, 2:]
    arm = float(np.mean(np.linalg.norm(np.array(vehicle.rotor_positions), axis=1)))
    return FlightState(
        v=_above_noise(flight.from_mids(attitude.rotate_back(mids.q, flight.wrench_states[1][:, V])), log.v),
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
    """Return values (m, 3) with each axis shrunk by its share of signal, given the white noise of the readings (n, 3).

    An axis that hardly moves is mostly noise. Its derivative shares that noise, so that torque would seem to depend on
    it. The noise is the mean over the three axes, because v is rotated from W to B.

    Source: Wiener gain; `LEAST_SIGNAL_TO_NOISE` is own choice.
    """
    noise = np.mean(np.diff(read, n=2, axis=0) ** 2) / 6.0  # second differences have six times the variance
    return values * np.clip(1 - LEAST_SIGNAL_TO_NOISE * noise / np.maximum(values.var(axis=0), 1e-12), 0.0, 1.0)
