"""A payload as a hidden state: a pendulum that the quadrotor's measured motion drives."""

import dataclasses as dc
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.residuals import FORCE, FlightResiduals
from np_drake.effects.pendulum import across, swing_many

if TYPE_CHECKING:
    from np_drake.diagnosis.forward_model.term import Term

STATE = 4  # swing angles [rad] and their rates [rad/s] about the direction of rest
MOST_JUMPS = 4  # in a flight: what a tether that snaps taut does to the swing is not told by sampled motion
APART = 0.3  # between jumps, at least [s]


def pendulum_error(name: str, value: float, priors: Priors) -> float:
    """Deviation of a payload's figure that its fit does not know of: motion that drives it is read with noise, and a

    tether that snaps is no pendulum.   Source: own choice.
    """
    kind = name.split("_")[0]
    errors = {"mass": priors.pendulum_mass, "length": priors.pendulum_length, "hook": priors.pendulum_hook}
    return errors[kind] * (1.0 if kind == "hook" else abs(value))


def jumps(flight: FlightResiduals, onset: float | None) -> np.ndarray:
    """(k,) rows of the grid right after shocks, where the swing may have jumped."""
    if onset == float("inf"):
        return np.zeros(0, int)
    ends = np.flatnonzero(np.diff(flight.shocks.astype(int)) < 0) + 1
    after = (flight.t[0] if onset is None else onset) + APART
    kept: list[int] = []
    for k in ends:
        if flight.t[k] > after and len(kept) < MOST_JUMPS:
            kept.append(int(k))
            after = flight.t[k] + APART
    return np.array(kept, int)


def hidden_size(flight: FlightResiduals, onset: float | None) -> int:
    """Figures of the hidden state of a payload in a flight: its initial swing, and a jump after every shock."""
    return STATE * (1 + len(jumps(flight, onset)))


def swing_units(size: int, rate: float) -> np.ndarray:
    """(size,) one radian for angles, and for their rates what has the same energy at the natural rate [1/s]."""
    return np.tile([1.0, 1.0, rate, rate], size // STATE)


def padded(hidden: np.ndarray | None, size: int) -> np.ndarray:
    """(size,) the figures that are known, zeros for the others."""
    known = np.zeros(0) if hidden is None else hidden[:size]
    return np.concatenate([known, np.zeros(size - len(known))])


def hook_acceleration(flight: FlightResiduals, hooks: np.ndarray) -> np.ndarray:
    """(n-1, m, 3) in W at the middle of the grid's steps [m/s²], of hooks (m, 3) in body axes; of one if all are it."""
    own = hooks[:1] if np.all(hooks == hooks[0]) else hooks
    a, lever = flight.driving[..., 0], flight.driving[..., 1:]
    return a[:, None] + np.swapaxes(lever @ own.T, 1, 2)


def start_of_swing(lengths: np.ndarray, swing: np.ndarray, pull: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m, 3) r and r_rate of pendula of `lengths` (m,) whose swing (m, 4) is counted from rest along -`pull` (3,)."""
    down = -pull / np.linalg.norm(pull)
    e_x, e_y = across(down)
    side = swing[:, :1] * e_x + swing[:, 1:2] * e_y
    angle = np.linalg.norm(side, axis=1, keepdims=True)
    n = np.cos(angle) * down + np.sinc(angle / np.pi) * side
    rate = swing[:, 2:3] * e_x + swing[:, 3:4] * e_y
    rate = rate - n * np.sum(n * rate, axis=1, keepdims=True)
    return lengths[:, None] * n, lengths[:, None] * rate


def specific_pull(
    flight: FlightResiduals, lengths: np.ndarray, swing: np.ndarray, hooks: np.ndarray, onset: float | None
) -> np.ndarray:
    """(n, m, 3) force on the hook per payload mass, body axes [m/s²], at the grid's times; zero before the onset,

    but for what the grid's low-pass smears.

    Args: lengths (m,) [m]; hooks (m, 3) or (1, 3) [m]; swing (m, `hidden_size` or less): at the start (see
        `start_of_swing`), then the jumps.
    """
    a = hook_acceleration(flight, hooks)
    first = 0 if onset is None else int(np.clip(np.searchsorted(flight.t, onset), 0, len(a) - 2))
    weight = np.array([0.0, 0.0, flight.vehicle.gravity])
    window = a[first : first + 25, 0].mean(axis=0)
    r, r_rate = start_of_swing(lengths, swing[:, :STATE], window + weight)
    at = zip(jumps(flight, onset) - first, range(STATE, swing.shape[1], STATE), strict=False)
    jumped = {int(k): swing[:, j : j + STATE] for k, j in at}
    driving = a[first:, 0] if a.shape[1] == 1 else a[first:]
    middle = swing_many(lengths, r, r_rate, driving, flight.grid.step, flight.vehicle.gravity, jumped)
    at_grid = np.concatenate([middle[:1], 0.5 * (middle[1:] + middle[:-1]), middle[-1:]])
    if onset is None:
        return at_grid @ flight.R_WB
    begun = flight.begun(onset)[:, None, FORCE]
    held = np.concatenate([np.repeat(at_grid[:1], first, axis=0), at_grid])
    return begun * (held @ flight.R_WB)


def swing_wrenches(flight: FlightResiduals, terms: "Sequence[Term]") -> np.ndarray:
    """(n, m, 6) wrenches of payloads in body axes, all with the onset of the first: many cost little more than one."""
    onset = terms[0].begins(flight.name)
    if onset == float("inf"):
        return np.zeros((len(flight.t), len(terms), 6))
    payloads = [t.effect.payload for t in terms]  # type: ignore[attr-defined]
    hooks = np.array([p.hook for p in payloads])
    size = hidden_size(flight, onset)
    swing = np.array([padded(t.hidden.get(flight.name), size) for t in terms])
    pull = specific_pull(flight, np.array([p.length for p in payloads]), swing, hooks, onset)
    force = np.array([p.mass for p in payloads])[:, None] * pull
    return np.concatenate([force, np.cross(hooks, force)], axis=2)


def swing_wrench(flight: FlightResiduals, term: "Term") -> np.ndarray:
    """(n, 6) wrench of one suspended payload in body axes; of one that may swing in many ways, their mean."""
    ways = np.atleast_2d(term.hidden.get(flight.name, np.zeros(0)))
    terms = [dc.replace(term, hidden={flight.name: way}) for way in ways]
    return swing_wrenches(flight, terms).mean(axis=1)
