"""Estimate of the drag that feels gusts, free of the bias of a vehicle that yields to them."""

import dataclasses as dc
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.numerics import Block, instrumented
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause, Estimate
from np_drake.diagnosis.wind.force_bins import drags, factor, forces, instants, spans, width
from np_drake.diagnosis.wind.gauss_markov import Begins, WindForce, Z, wind_force
from np_drake.effects.linear_drag import LinearDrag

SIZES = np.geomspace(0.01, 3.0, 60)  # that axes may share [N·s/m]; own choice
ROUNDS = 3  # of gusts from the drag and drag under the gusts
WEAKEST = 1e-4  # level drag that feels anything [N·s/m]; own choice
STEEPEST = 5.0  # by which the upright axis may feel gusts more, or less, than the level ones [1]; own choice
FIGURES = LinearDrag.parameters


def drag_in_gusts(
    drag: Cause,
    flights: Sequence[FlightResiduals],
    felt: Mapping[str, np.ndarray],
    begins: Begins,
    priors: Priors,
) -> Cause | None:
    """Return the drag with parameters and intervals under the covariance of gusts; None where it feels no wind.

    The drag stays as it is where it has no such parameters. Where the drag that was found would feel no wind, least
    squares having lost it to the gusts, one is sought from its usual size. Where the drag acts before the wind begins,
    what is felt until then counts with white noise alone.

    Args:
        felt: by flight, (m, 15) what drag and wind together leave in it.
        begins: by flight, when the wind begins [s]; None: from the start.
    Source: `instruments`; level axes share most of their size, as those of one airframe do (own choice: `drag_axes`;
    x and y of rotor drag 0.54 and 0.39 1/s, Faessler et al. 2018).
    """
    found = np.array([drag.parameters[p.name].value for p in FIGURES])
    known = _feels(found)
    d = found if known else np.array([p.typical for p in FIGURES])
    early = all(drag.onset.get(e.name) is None for e in flights)
    pieces = [piece for e in flights for piece in _pieces(e, felt[e.name], begins.get(e.name), early=early)]
    for _ in range(ROUNDS):
        if not _feels(d):
            return drag if known else None
        residual = {e.name: felt[e.name] - drag_trace(e, LinearDrag(*d.tolist()), begins) for e in flights}
        d, deviation = _estimate(pieces, width(flights[0]), wind_force(flights, residual, begins), d, priors)
    if not _feels(d):
        return drag if known else None
    figures = {
        p.name: Estimate(value, p.unit, (value - Z * sd, value + Z * sd))
        for p, value, sd in zip(FIGURES, d.tolist(), deviation.tolist(), strict=True)
    }
    return dc.replace(drag, parameters=figures, effect=LinearDrag(*d.tolist()))


def drag_trace(e: FlightResiduals, drag: LinearDrag, begins: Begins) -> np.ndarray:
    """Return (m, 15) the predicted residual of a drag alone, from its begin in this flight on."""
    return predicted_residual(e, [Term(drag, {e.name: begins.get(e.name)})])


def _feels(d: np.ndarray) -> bool:
    """Return whether a wind acts through this drag: physical, and not negligible."""
    inside = all(p.lower <= value <= p.upper for p, value in zip(FIGURES, d, strict=True))
    return inside and float(np.mean(d[:2])) > WEAKEST


@dc.dataclass(frozen=True)
class _Piece:
    """Bins in a row: force (k, 3) in W [N]; columns (k, 3, 3) of a unit drag [m/s]; blown: whether the wind blows."""

    force: np.ndarray
    columns: np.ndarray
    blown: bool


def _pieces(e: FlightResiduals, felt: np.ndarray, begin: float | None, *, early: bool) -> list[_Piece]:
    """Of a flight from the wind's begin on; `early`: and before it."""
    both = np.hstack([forces(e, felt), drags(e).reshape(-1, 9)])
    found = [(span, True) for span in spans(e, both, begin)]
    calm = both[instants(e) < begin - width(e)] if early and begin is not None else both[:0]
    if len(calm) > 1:
        found.append((calm, False))
    return [_Piece(span[:, :3], span[:, 3:].reshape(-1, 3, 3), blown) for span, blown in found]


def _estimate(
    pieces: Sequence[_Piece], width: float, gusts: WindForce, d: np.ndarray, priors: Priors
) -> tuple[np.ndarray, np.ndarray]:
    """(3,) drag and (3,) its deviation [N·s/m], beside a mean force in W; from the drag d (3,) that was known."""
    return _of_one_airframe(*instrumented(_blocks(pieces, width, gusts, d)), priors)


def _blocks(pieces: Sequence[_Piece], width: float, gusts: WindForce, d: np.ndarray) -> Iterator[Block]:
    """By piece and axis of W, drags and a mean force; along an axis gusts are as strong as its drag, of d (3,)."""
    deviation, time, white = gusts.figures
    steep = float(np.clip(abs(d[2]) / np.mean(d[:2]), 1 / STEEPEST, STEEPEST))
    for piece in pieces:
        for axis in range(3):
            X = np.zeros((len(piece.force), 6))
            X[:, :3], X[:, 3 + axis] = piece.columns[:, axis], float(piece.blown)
            gust = deviation * (steep if axis == 2 else 1.0) if piece.blown else 0.0
            yield X, piece.force[:, axis], factor(len(X), width, gust, time, white)


def _of_one_airframe(
    precision: np.ndarray, target: np.ndarray, priors: Priors
) -> tuple[np.ndarray, np.ndarray]:
    """(3,) mean and (3,) deviation of three drags that share a size, of which `SIZES` are tried, beside a mean force.

    precision (6, 6), target (6,): of the estimate that the data alone give, and times it.   Source: Bayes; a size of
    which one is sought instead goes to none where data say little of level axes.
    """
    apart = np.array(priors.drag_axes)
    some, means, covariances = np.zeros(len(SIZES)), np.zeros((len(SIZES), 3)), np.zeros((len(SIZES), 3, 3))
    for i, size in enumerate(SIZES):
        prior, pull = np.zeros((6, 6)), np.zeros(6)
        prior[:3, :3], pull[:3] = np.diag((apart * size) ** -2.0), size / (apart * size) ** 2
        inverse = np.linalg.inv(precision + prior)
        solution = inverse @ (target + pull)
        means[i], covariances[i] = solution[:3], inverse[:3, :3]
        some[i] = 0.5 * (np.linalg.slogdet(inverse)[1] + (target + pull) @ solution) - 3 * np.log(size)
        some[i] -= 0.5 * (np.log(size / FIGURES[0].typical) / priors.drag_spread) ** 2
    weight = np.exp(some - some.max())
    weight /= weight.sum()
    mean = weight @ means
    spread = weight @ (means - mean) ** 2
    return mean, np.sqrt(weight @ np.diagonal(covariances, axis1=1, axis2=2) + spread)
