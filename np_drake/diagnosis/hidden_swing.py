"""A payload as a hidden state: a pendulum that the quadrotor's measured motion drives."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.evidence import Evidence
from np_drake.effects.pendulum import swing_many

if TYPE_CHECKING:
    from np_drake.diagnosis.signature import Term

STATE = 4  # swing angles [rad] and their rates [rad/s] about the direction of rest


def hook_acceleration(evidence: Evidence, hooks: np.ndarray) -> np.ndarray:
    """(n-1, m, 3) in W at the middle of the grid's steps [m/s²], smoothed, of hooks (m, 3) in body axes."""
    rows = evidence.rows
    w, al = rows.x[:, None, 10:13], rows.al[:, None]
    unique, which = np.unique(hooks, axis=0, return_inverse=True)
    at_hook = rows.s[:, None] + np.cross(al, unique) + np.cross(w, np.cross(w, unique))
    a = np.einsum("nij,nmj->nmi", attitude.rotation_matrix(rows.q), at_hook)
    a[..., 2] -= evidence.vehicle.gravity
    middle = 0.5 * (evidence.t[1:] + evidence.t[:-1])
    flat = a.reshape(len(a), -1)
    out = np.stack([np.interp(middle, rows.t, column) for column in flat.T], axis=1)
    out = out.reshape(len(middle), -1, 3)
    return out if len(unique) == 1 else out[:, which.ravel()]


def attitude_on_grid(evidence: Evidence) -> np.ndarray:
    """(m, 4) at the grid's times."""
    rows = evidence.rows
    near = attitude.one_hemisphere(rows.q, rows.q[0])
    q = np.stack([np.interp(evidence.t, rows.t, component) for component in near.T], axis=1)
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def start_of_swing(lengths: np.ndarray, swing: np.ndarray, pull: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m, 3) r and r_rate of pendula of `lengths` (m,) whose swing (m, 4) is counted from rest along -`pull` (3,)."""
    down = -pull / np.linalg.norm(pull)
    e_x = np.cross([0.0, 1.0, 0.0], -down)
    e_x = e_x / np.linalg.norm(e_x)
    e_y = np.cross(-down, e_x)
    side = swing[:, :1] * e_x + swing[:, 1:2] * e_y
    angle = np.linalg.norm(side, axis=1, keepdims=True)
    n = np.cos(angle) * down + np.sinc(angle / np.pi) * side
    rate = swing[:, 2:3] * e_x + swing[:, 3:4] * e_y
    rate = rate - n * np.sum(n * rate, axis=1, keepdims=True)
    return lengths[:, None] * n, lengths[:, None] * rate


def specific_pull(
    evidence: Evidence, lengths: np.ndarray, swing: np.ndarray, hooks: np.ndarray, onset: float | None
) -> np.ndarray:
    """(n, m, 3) force on the hook per payload mass, body axes [m/s²], at the grid's times; zero before the onset.

    Args: lengths (m,) [m]; swing (m, 4) at the start (see `start_of_swing`); hooks (m, 3) or (1, 3) [m].
    """
    a = hook_acceleration(evidence, hooks)
    first = 0 if onset is None else int(np.clip(np.searchsorted(evidence.t, onset), 0, len(a) - 2))
    weight = np.array([0.0, 0.0, evidence.vehicle.gravity])
    window = a[first : first + 25, 0].mean(axis=0)
    r, r_rate = start_of_swing(lengths, swing, window + weight)
    driving = a[first:, 0] if a.shape[1] == 1 else a[first:]
    middle = swing_many(lengths, r, r_rate, driving, evidence.grid.step, evidence.vehicle.gravity)
    at_grid = np.concatenate([middle[:1], 0.5 * (middle[1:] + middle[:-1]), middle[-1:]])
    R = attitude.rotation_matrix(attitude_on_grid(evidence)[first:])
    out = np.zeros((len(evidence.t), len(lengths), 3))
    out[first:] = at_grid @ R
    return out


def swing_wrenches(evidence: Evidence, terms: "Sequence[Term]") -> np.ndarray:
    """(n, m, 6) wrenches of payloads in body axes, all with the onset of the first: many cost little more than one."""
    onset = terms[0].begins(evidence.name)
    if onset == float("inf"):
        return np.zeros((len(evidence.t), len(terms), 6))
    payloads = [t.effect.payload for t in terms]  # type: ignore[attr-defined]
    hooks = np.array([p.hook for p in payloads])
    swing = np.array([t.hidden.get(evidence.name, np.zeros(STATE)) for t in terms])
    pull = specific_pull(evidence, np.array([p.length for p in payloads]), swing, hooks, onset)
    force = np.array([p.mass for p in payloads])[:, None] * pull
    return np.concatenate([force, np.cross(hooks, force)], axis=2)


def swing_wrench(evidence: Evidence, term: "Term") -> np.ndarray:
    """(n, 6) wrench of one suspended payload in body axes."""
    return swing_wrenches(evidence, [term])[:, 0]
