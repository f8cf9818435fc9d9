"""What generic structure may depend on: the state of a flight on its grid."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.evidence import Evidence
from np_drake.diagnosis.grid import to_grid


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


def flight_state(evidence: Evidence) -> FlightState:
    """Of one flight."""
    mids, vehicle = evidence.mids, evidence.vehicle
    u = evidence.nominal[:, 2:]
    arm = float(np.mean(np.linalg.norm(np.array(vehicle.rotor_positions), axis=1)))
    return FlightState(
        v=to_grid(evidence.grid, mids.t, attitude.rotate_back(mids.q, mids.x[:, 7:10])),
        p=to_grid(evidence.grid, mids.t, mids.x[:, :3]),
        w=evidence.w,
        R=to_grid(evidence.grid, mids.t, attitude.rotation_matrix(mids.q)),
        u=u,
        rotor=u @ vehicle.unmixer.T,
        t=evidence.t,
        mixer=vehicle.mixer,
        torque_unit=arm * np.array([0.3, 0.3, 0.1]),
        weight=vehicle.mass * vehicle.gravity,
        gravity=vehicle.gravity,
        step=evidence.grid.step,
    )
