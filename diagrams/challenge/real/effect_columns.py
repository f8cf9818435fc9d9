"""Columns of effects for least squares on the residual wrench of all flights."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.regressors import library_candidates
from np_drake.diagnosis.residuals.flight_residuals import FlightResiduals
from np_drake.effects.base import Motion
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.pendulum import hanging, swing_many
from np_drake.logs.importing.signals import Signal
from np_drake.rigid_body import V

WRENCH = 6  # channels: force and torque in B
LENGTHS = np.geomspace(0.2, 2.0, 24)  # of payloads [m]
DAMPING = 0.1  # of payloads by the air [1/s]; as in flights of five grams
SMALL = 0.05  # displacement of a start state over length and natural rate [1]
SHARE = 0.1  # of the vehicle's mass, in units of which start states of payloads are fitted [1]


@dc.dataclass(frozen=True)
class Columns:
    """Columns X (rows, 6, k) of one effect over all flights."""

    identifier: str
    X: np.ndarray


def stacked(flights: Sequence[FlightResiduals]) -> np.ndarray:
    """Return the residual wrench of all flights, (rows, 6) [N, N·m]."""
    return np.concatenate([e.y[:, :WRENCH] for e in flights])


def library_columns(flights: Sequence[FlightResiduals]) -> list[Columns]:
    """Return the columns of the library's effects, wind and payload apart, that act on the
    wrench.
    """
    found = []
    for candidate in library_candidates(flights):
        X = np.concatenate([candidate.columns[e.name][:, :WRENCH] for e in flights])
        if np.any(X):
            found.append(Columns(candidate.identifiers[0], X))
    return found


def wind_columns(flights: Sequence[FlightResiduals]) -> Columns:
    """Return a constant force in W, one a newton along each axis: a steady wind through a drag."""
    X = np.zeros((sum(len(e.t) for e in flights), WRENCH, 3))
    X[:, :3] = np.concatenate([e.R_WB.transpose(0, 2, 1) for e in flights])
    return Columns("constant_wind", X)


def drag_columns(flights: Sequence[FlightResiduals]) -> Columns:
    """Return the force of `linear_drag` by coefficient of each body axis [N per N s/m]."""
    parts = []
    for e in flights:
        thrust = np.repeat(0.25 * e.nominal[:, 2:3], 4, axis=1)
        x = Signal(e.rows.t, e.rows.x).linear(e.t)
        x[:, 3:7] = e.q
        motion = Motion(e.t, x, thrust)
        forces = [LinearDrag(*row).wrench(e.vehicle, motion)[:, :3] for row in np.eye(3).tolist()]
        parts.append(np.stack([np.einsum("nji,nj->ni", e.R_WB, f) for f in forces], axis=-1))
    force = np.concatenate(parts)
    return Columns("linear_drag", np.concatenate([force, np.zeros_like(force)], axis=1))


def payload_columns(
    flights: Sequence[FlightResiduals], lengths: np.ndarray, starts: np.ndarray | None = None
) -> list[Columns]:
    """Return, for every tether length, the force of a payload per mass and its change with the
    start of every flight.

    Args:
        lengths: (k,) of the tether [m].
        starts: (k, flights, 4) about which the swing is linear: offsets and rates to the side, over
            length and over length times natural rate [1]; None: it hangs still.
    """
    starts = np.zeros((len(lengths), len(flights), 4)) if starts is None else starts
    rows = [len(e.t) for e in flights]
    X = np.zeros((len(lengths), sum(rows), WRENCH, 1 + 4 * len(flights)))
    moves = np.concatenate([np.zeros((1, 4)), SMALL * np.eye(4)])
    for i, e in enumerate(flights):
        here = slice(sum(rows[:i]), sum(rows[: i + 1]))
        pull = _pulls(e, np.repeat(lengths, 5), (starts[:, i, None] + moves).reshape(-1, 4))
        force = np.einsum("nji,nkj->kni", e.R_WB, pull).reshape(len(lengths), 5, -1, 3)
        X[:, here, :3, 0] = force[:, 0]
        X[:, here, :3, 1 + 4 * i : 5 + 4 * i] = np.moveaxis(force[:, 1:] - force[:, :1], 1, -1)
    X[..., 1:] *= SHARE * flights[0].vehicle.mass  # start states count in products with the mass
    return [Columns("suspended_payload", own) for own in X]


def _pulls(e: FlightResiduals, lengths: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Return the pull on the vehicle per mass of m payloads on the grid, (rows, m, 3) in W [m/s²].

    The hook is at Bo.
    lengths: (m,) [m].
    states: (m, 4) at the start, over length and natural rate [1].
    """
    on_grid = Signal(e.rows.t, np.concatenate([e.rows.a, e.rows.x[:, V]], axis=1)).linear(e.t)
    gravity = e.vehicle.gravity
    rate = np.sqrt(gravity / lengths)
    scale = np.stack([lengths, lengths, lengths * rate, lengths * rate], axis=1)
    r, r_rate = hanging((scale * states)[:, :2], (scale * states)[:, 2:], lengths)
    between = 0.5 * (on_grid[1:] + on_grid[:-1])
    a, v = between[:, :3], between[:, 3:]
    steps = swing_many(lengths, r, r_rate, a, e.grid.step, gravity, damping=DAMPING, v_hook=v)
    return np.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])
