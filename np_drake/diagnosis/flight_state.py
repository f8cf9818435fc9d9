"""What generic structure may depend on: the state of a flight on its grid."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.evidence import Evidence, low_pass
from np_drake.diagnosis.grid import to_grid

DRIVE_BAND = (
    4.0  # of the specific force that drives a resonance; from velocity, whose noise is not the force's [Hz]
)


@dc.dataclass(frozen=True)
class FlightState:
    """On the grid: v, w, s (m, 3) in B [m/s, rad/s, m/s²], p (m, 3) in W [m], R (m, 3, 3), u (m, 4) nominal

    [f, tau], rotor (m, 4) nominal thrusts [N], t (m,) [s]; mixer (4, 4); torque_unit (3,): arms of the prior [m].
    """

    v: np.ndarray
    p: np.ndarray
    w: np.ndarray
    s: np.ndarray
    R: np.ndarray
    u: np.ndarray
    rotor: np.ndarray
    t: np.ndarray
    mixer: np.ndarray
    torque_unit: np.ndarray
    step: float


def flight_state(evidence: Evidence) -> FlightState:
    """Of one flight."""
    mids, log, vehicle = evidence.mids, evidence.log, evidence.vehicle
    g = np.array([0.0, 0.0, vehicle.gravity])
    rate = low_pass(np.diff(log.v, axis=0) / np.diff(log.t)[:, None], log.step, DRIVE_BAND)
    u = evidence.nominal[:, 2:]
    arm = float(np.mean(np.linalg.norm(np.array(vehicle.rotor_positions), axis=1)))
    return FlightState(
        v=to_grid(evidence.grid, mids.t, attitude.rotate_back(mids.q, mids.x[:, 7:10])),
        p=to_grid(evidence.grid, mids.t, mids.x[:, :3]),
        w=evidence.w,
        s=to_grid(evidence.grid, mids.t, attitude.rotate_back(mids.q, rate + g)),
        R=to_grid(evidence.grid, mids.t, attitude.rotation_matrix(mids.q)),
        u=u,
        rotor=u @ vehicle.unmixer.T,
        t=evidence.t,
        mixer=vehicle.mixer,
        torque_unit=arm * np.array([0.3, 0.3, 0.1]),
        step=evidence.grid.step,
    )
