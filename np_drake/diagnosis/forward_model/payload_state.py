"""Terms of a model, and the hidden state of one that is a payload: a pendulum driven by the
measured motion.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.residuals import FORCE, OUTLIERS_APART, FlightResiduals
from np_drake.effects.base import Effect
from np_drake.effects.pendulum import across, swing_many
from np_drake.effects.rotor_inflow import hover_induced_velocity
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle

NEVER = float("inf")  # onset of an effect that is absent from a flight [s]
STATE = 4  # swing angles [rad] and their rates [rad/s] about the direction of rest
MOST_JUMPS = 4  # in a flight; sampled motion does not show how a snap changes the swing
PENDULUM = {
    "mass": 1.0,
    "length": 0.4,
    "hook": 0.05,
    "damping": 0.5,
}  # errors over that of the mass [1, 1, m, 1/s]


@dc.dataclass(frozen=True)
class Term:
    """Effect in a model of the logs.

    onset: by flight, the time at which it begins [s]; missing or None: from the start; `NEVER`:
    absent.
    hidden: by flight, the hidden state (size,), a payload's initial swing and its jumps at
        outliers. It may hold several samples (k, size), whose mean prediction counts.
    """

    effect: Effect
    onset: dict[str, float | None] = dc.field(default_factory=dict)
    hidden: dict[str, np.ndarray] = dc.field(default_factory=dict)

    @property
    def has_hidden_state(self) -> bool:
        """Whether the effect has a hidden swing."""
        return self.effect.has_hidden_state

    def begins(self, flight: str) -> float | None:
        """Return the onset in this flight [s]."""
        return self.onset.get(flight)


def with_dependants(terms: Sequence[Term], i: int) -> set[int]:
    """Return term i and the terms that act through it alone, as a wind through a drag."""
    left = {t.effect.identifier for k, t in enumerate(terms) if k != i}
    return {i, *(k for k, t in enumerate(terms) if t.effect.needs and not left & {*t.effect.needs})}


def pendulum_error(name: str, payload: SuspendedPayload, vehicle: Vehicle, priors: Priors) -> float:
    """Return the standard deviation of a payload parameter that its fit does not account for, in
    the parameter's unit.

    The downwash w that damps a payload pushes it down as well: c w / g more weight makes the mass
    too large and the tether too short by that share. It is between none and twice the induced
    velocity of hover.

    Args:
        name: name of the parameter, beginning with mass, length, hook or damping.
    Source: own choice, from errors in simulated flights; w from momentum theory.
    """
    kind, value = name.split("_")[0], float(getattr(payload, name))
    own = priors.pendulum * PENDULUM[kind]
    if kind in ("hook", "damping"):
        return own
    return abs(value) * float(
        np.hypot(own, payload.damping * hover_induced_velocity(vehicle) / vehicle.gravity)
    )


def jumps(flight: FlightResiduals, onset: float | None) -> np.ndarray:
    """Return the rows (k,) of the grid right after outliers, at which the swing may jump.

    Args:
        onset: time at which it begins [s]; None: from the start; infinite: not at all.
    """
    if onset == NEVER:
        return np.zeros(0, int)
    ends = np.flatnonzero(np.diff(flight.outliers.astype(int)) < 0) + 1
    after = (flight.t[0] if onset is None else onset) + OUTLIERS_APART
    kept: list[int] = []
    for k in ends:
        if flight.t[k] > after and len(kept) < MOST_JUMPS:
            kept.append(int(k))
            after = flight.t[k] + OUTLIERS_APART
    return np.array(kept, int)


def hidden_size(flight: FlightResiduals, onset: float | None) -> int:
    """Return the size of a payload's hidden state in a flight: its initial swing, and a jump after
    every outlier.

    Args:
        onset: time at which it begins [s]; None: from the start; infinite: not at all.
    """
    return STATE * (1 + len(jumps(flight, onset)))


def swing_units(size: int, rate: float) -> np.ndarray:
    """Return the scale (size,) of a hidden state: 1 rad for angles, and for rates the value of
    equal energy.

    Args:
        rate: natural rate [1/s].
    """
    return np.tile([1.0, 1.0, rate, rate], size // STATE)


def padded(hidden: np.ndarray | None, size: int) -> np.ndarray:
    """Return the known entries of a hidden state, padded with zeros to (size,).

    Args:
        hidden: known entries; None: none.
    """
    known = np.zeros(0) if hidden is None else hidden[:size]
    return np.concatenate([known, np.zeros(size - len(known))])


def _at_hooks(motion: np.ndarray, hooks: np.ndarray) -> np.ndarray:
    """Return the motion (n-1, m, 3) in W of hooks (m, 3) at the middles of the grid's steps; m is 1
    where all are one.

    motion: (n-1, 3, 4) of Bo and of its levers, `FlightResiduals.driving` [m/s², 1/s²] or `moving`
    [m/s, 1/s].
    """
    own = hooks[:1] if np.all(hooks == hooks[0]) else hooks
    return motion[:, None, :, 0] + np.swapaxes(motion[..., 1:] @ own.T, 1, 2)


def _start_of_swing(
    lengths: np.ndarray, swing: np.ndarray, pull: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the initial position (m, 3) [m] and velocity (m, 3) [m/s] of payloads relative to
    their hooks, in W.

    lengths: (m,) [m].
    swing: (m, 4) angles [rad] and rates [rad/s] from rest, along -`pull`, (3,) in W [m/s²].
    """
    down = -pull / np.linalg.norm(pull)
    e_x, e_y = across(down)
    side = swing[:, :1] * e_x + swing[:, 1:2] * e_y
    angle = np.linalg.norm(side, axis=1, keepdims=True)
    n = np.cos(angle) * down + np.sinc(angle / np.pi) * side
    rate = swing[:, 2:3] * e_x + swing[:, 3:4] * e_y
    rate = rate - n * np.sum(n * rate, axis=1, keepdims=True)
    return lengths[:, None] * n, lengths[:, None] * rate


def specific_pull(
    flight: FlightResiduals,
    lengths: np.ndarray,
    swing: np.ndarray,
    hooks: np.ndarray,
    onset: float | None,
    damping: float | np.ndarray = 0.0,
) -> np.ndarray:
    """Return the force (n, m, 3) of payloads on their hooks in B per payload mass, on the grid
    [m/s²].

    Args:
        lengths: (m,) tether lengths [m].
        swing: (m, k) initial swing (`start_of_swing`), then jumps; k at most `hidden_size`.
        hooks: (m, 3) or (1, 3) positions p_BoTo_B [m].
        onset: time at which the payload is attached [s]; None: from the start.
        damping: of all or of each, (m,) [1/s].
    """
    a = _at_hooks(flight.driving, hooks)
    first = 0 if onset is None else int(np.clip(np.searchsorted(flight.t, onset), 0, len(a) - 2))
    weight = np.array([0.0, 0.0, flight.vehicle.gravity])
    window = a[first : first + 25, 0].mean(axis=0)
    r, r_rate = _start_of_swing(lengths, swing[:, :STATE], window + weight)
    at = zip(jumps(flight, onset) - first, range(STATE, swing.shape[1], STATE), strict=False)
    jumped = {int(k): swing[:, j : j + STATE] for k, j in at}
    driving = a[first:, 0] if a.shape[1] == 1 else a[first:]
    v_hook = _at_hooks(flight.moving, hooks)[first:] if np.any(damping) else None
    middle = swing_many(
        lengths,
        r,
        r_rate,
        driving,
        flight.grid.step,
        flight.vehicle.gravity,
        jumped,
        damping=damping,
        v_hook=v_hook,
    )
    at_grid = np.concatenate([middle[:1], 0.5 * (middle[1:] + middle[:-1]), middle[-1:]])
    if onset is None:
        return at_grid @ flight.R_WB
    begun = flight.begun(onset)[:, None, FORCE]
    held = np.concatenate([np.repeat(at_grid[:1], first, axis=0), at_grid])
    return begun * (held @ flight.R_WB)


def swing_wrenches(flight: FlightResiduals, terms: Sequence[Term]) -> np.ndarray:
    """Return the wrenches (n, m, 6) of payloads in B on the grid [N, N·m].

    Args:
        terms: payloads, which begin at the onset of the first.
    """
    onset = terms[0].begins(flight.name)
    if onset == NEVER:
        return np.zeros((len(flight.t), len(terms), 6))
    payloads = [t.effect.payload for t in terms]  # type: ignore[attr-defined]
    hooks = np.array([p.hook for p in payloads])
    size = hidden_size(flight, onset)
    swing = np.array([padded(t.hidden.get(flight.name), size) for t in terms])
    lengths, damping = (
        np.array([getattr(p, name) for p in payloads]) for name in ("length", "damping")
    )
    pull = specific_pull(flight, lengths, swing, hooks, onset, damping)
    force = np.array([p.mass for p in payloads])[:, None] * pull
    return np.concatenate([force, np.cross(hooks, force)], axis=2)


def swing_wrench(flight: FlightResiduals, term: Term) -> np.ndarray:
    """Return the wrench (n, 6) of one suspended payload in B on the grid, the mean over samples of
    its state [N, N·m].
    """
    ways = np.atleast_2d(term.hidden.get(flight.name, np.zeros(0)))
    terms = [dc.replace(term, hidden={flight.name: way}) for way in ways]
    return swing_wrenches(flight, terms).mean(axis=1)
