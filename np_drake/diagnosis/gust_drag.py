"""The drag that feels gusts: a vehicle yields to a gust, which least squares would take for less drag."""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import linalg

from np_drake.diagnosis.answer import Cause, Estimate
from np_drake.diagnosis.evidence import Evidence
from np_drake.diagnosis.force_bins import drags, factor, forces, spans, width
from np_drake.diagnosis.signature import Term, signature
from np_drake.diagnosis.wind_statistics import Begins, WindForce, Z, wind_force
from np_drake.effects.linear_drag import LinearDrag

ALIKE = np.array(
    [0.3, 0.3, 1.0]
)  # by which axes differ from what they share: level, level, upright [1]; own choice
ROUNDS = 3  # of gusts from the drag and drag under the gusts
WEAKEST = 1e-4  # drag that feels anything [N·s/m]
Axes = ("d_x", "d_y", "d_z")


def drag_in_gusts(
    drag: Cause, flights: Sequence[Evidence], felt: Mapping[str, np.ndarray], begins: Begins
) -> Cause:
    """The drag with figures and intervals under the gusts' own covariance; as it is, where that is none.

    Args:
        felt: by flight, (m, 15) what drag and wind together leave in it.
        begins: by flight, when both begin [s]; None: from the start.
    Source: generalised least squares with instrumental variables. A gust changes the velocity within its own bin, so
    that each bin's velocity is known from those before it; level axes are alike as those of one airframe are (own
    choice: `ALIKE`; x and y of rotor drag 0.54 and 0.39 1/s, Faessler et al. 2018).
    """
    d = np.array([drag.parameters[axis].value for axis in Axes])
    for _ in range(ROUNDS):
        gusts = wind_force(flights, {e.name: felt[e.name] - _trace(e, d, begins) for e in flights}, begins)
        d, deviation = _estimate(flights, felt, begins, gusts, float(np.mean(np.abs(d[:2]))))
        if not np.all(np.isfinite(deviation)) or d[:2].mean() < WEAKEST:
            return drag
    found = {
        axis: Estimate(float(value), "N·s/m", (float(value - Z * sd), float(value + Z * sd)))
        for axis, value, sd in zip(Axes, d, deviation, strict=True)
    }
    return dc.replace(drag, parameters=found, effect=_effect(d))


def _effect(d: np.ndarray) -> LinearDrag:
    return LinearDrag(*(float(value) for value in d))


def _trace(e: Evidence, d: np.ndarray, begins: Begins) -> np.ndarray:
    """(m, 15) of the drag alone."""
    return signature(e, [Term(_effect(d), {e.name: begins.get(e.name)})])


def _estimate(
    flights: Sequence[Evidence], felt: Mapping[str, np.ndarray], begins: Begins, gusts: WindForce, size: float
) -> tuple[np.ndarray, np.ndarray]:
    """(3,) drag and (3,) its deviation [N·s/m], beside a mean force in W. size: level drag that it starts from."""
    cross, own, target = np.zeros((7, 7)), np.zeros((7, 7)), np.zeros(7)
    for e in flights:
        F, D = forces(e, felt[e.name]), drags(e)
        pairs = zip(
            spans(e, F, begins.get(e.name)), spans(e, D.reshape(-1, 9), begins.get(e.name)), strict=True
        )
        for force, columns in pairs:
            root = factor(len(force), width(e), *gusts.figures)
            for axis in range(3):
                X = np.zeros((len(force), 7))
                X[:, :3] = columns.reshape(-1, 3, 3)[:, axis]
                X[:, 3 + axis] = 1.0
                white = linalg.solve_triangular(root, np.column_stack([X, force[:, axis]]), lower=True)
                instrument = white[:, :7] - (X - _known_before(X)) / np.diag(root)[:, None]
                cross += instrument.T @ white[:, :7]
                own += instrument.T @ instrument
                target += instrument.T @ white[:, 7]
    for _ in range(ROUNDS):
        prior = _of_like_size(size)
        solution = np.linalg.solve(cross + prior, target)
        size = max(float(solution[6]), WEAKEST)
    inverse = np.linalg.inv(cross + prior)
    deviation = np.sqrt(np.diag(inverse @ (own + prior) @ inverse.T))
    return solution[:3], deviation[:3]


def _known_before(X: np.ndarray) -> np.ndarray:
    """(k, a) columns as the two rows before each foretell it."""
    early = X[:1].repeat(min(2, len(X)), axis=0)
    return np.concatenate([early, 2 * X[1:-1] - X[:-2]])[: len(X)]


def _of_like_size(size: float) -> np.ndarray:
    """(7, 7) precision of three drags about what they share, the seventh unknown, which is as large as usual."""
    apart = np.zeros((3, 7))
    apart[:, :3], apart[:, 6] = np.eye(3), -1.0
    apart /= (ALIKE * size)[:, None]
    shared = np.diag([0.0] * 6 + [LinearDrag.parameters[0].typical ** -2])
    return apart.T @ apart + shared
