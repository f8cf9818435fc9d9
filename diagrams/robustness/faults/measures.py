"""Measures of a flight with faults: loss, NaN commands, time to recover."""

import numpy as np

from np_drake import attitude
from np_drake.mpc.problem import MpcStatus
from np_drake.rigid_body import Q

LOST = 2.0  # distance from the reference beyond which a vehicle counts as lost: the circle's diameter; own choice [m]
BACK = (
    0.3  # distance within which it has recovered; every controller is nearer before a fault; own choice [m]
)
ENDED = "the simulation ended"  # of the line of a flight whose integrator gave up


def measures(signals: dict[str, np.ndarray], *, onset: float, why: str = "") -> dict:
    """Return the measures of a flight.

    Args: onset: of the first fault [s].   why: the simulator's line, where it ended the flight.
    Returns: lost_at [s] or None, `lost`: the line; gave_up: whether the integrator ended it; nan_commands: periods with
        a command that is not finite; recovery: time from the onset to the last moment farther than `BACK` from the
        reference [s], 0 where it never was, None where it is not back at the end; before: largest error before the
        onset [m]; peak: largest after it [m]; tilt: largest [rad]; fallbacks: periods without a new plan.
    """
    t, x = signals["t"], signals["x_true"]
    error = np.linalg.norm(x[:, :3] - signals["p_ref"], axis=1)
    far, after = ~(error < LOST), t >= onset  # NaN is far
    lost = bool(why) or bool(far.any())
    away = np.flatnonzero(after & ~(error < BACK))
    recovery: float | None = float(t[away[-1]] - onset) if len(away) else 0.0
    if lost or (len(away) and away[-1] == len(t) - 1):
        recovery = None
    return {
        "lost_at": float(t[np.argmax(far)] if far.any() else t[-1]) if lost else None,
        "lost": why,
        "gave_up": ENDED in why,
        "nan_commands": int(np.sum(~np.isfinite(signals["u"]).all(axis=1))),
        "recovery": recovery,
        "before": float(error[~after].max(initial=0.0)),
        "peak": float(error[after].max(initial=0.0)),
        "tilt": float(np.arccos(np.clip(attitude.body_z(x[:, Q])[:, 2], -1.0, 1.0)).max()),
        "fallbacks": int(np.sum(signals["status"][:, 0] >= MpcStatus.SHIFTED_PLAN)),
    }
