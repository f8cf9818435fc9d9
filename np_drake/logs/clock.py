"""Time shift of a log whose state was stamped by another clock than its commands."""

import numpy as np

from np_drake import attitude
from np_drake.flight_log import FlightLog

_STATE = ("p", "q", "v", "w", "a", "al")  # fields that are shifted


def shift_state(log: FlightLog, offset: float) -> FlightLog:
    """Return the log with its state columns of row t taken from t + offset; u and rotor stay.

    The state columns are p, q, v, w, a, al. They are linear between rows, q normalised after it
    (its chord: an error of third order in the turn of a row); accelerations that jump with a
    command are smeared over one row. Rows whose t + offset lies outside the log are dropped.
    Source: effect `clock_offset`; undo it with the opposite sign.

    Args:
        offset: by which its state is later than its commands [s].
    Raises: ValueError: if fewer than two rows are left.
    """
    wanted = log.t + offset
    kept = np.flatnonzero((wanted >= log.t[0] - 1e-9) & (wanted <= log.t[-1] + 1e-9))
    if len(kept) < 2:
        raise ValueError(
            f"shift_state: offset must be shorter than {log.name}, "
            f"{log.t[-1] - log.t[0]:.4g} s; got {offset:g} s."
        )
    out = log.rows(int(kept[0]), int(kept[-1]) + 1)
    for name in _STATE:
        value = getattr(log, name)
        if value is not None:
            setattr(out, name, _at(log.t, value, wanted[kept], turn=name == "q"))
    out.notes.append(f"state columns shifted by {offset:g} s against the commands")
    return out


def _at(t: np.ndarray, value: np.ndarray, wanted: np.ndarray, *, turn: bool) -> np.ndarray:
    if turn:
        value = attitude.one_hemisphere(value, value[0])
    out = np.stack([np.interp(wanted, t, column) for column in value.T], axis=1)
    return out / np.linalg.norm(out, axis=1, keepdims=True) if turn else out
