"""Test of a slow force for dry friction against the way over ground, which gusts do not have."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from np_drake.diagnosis.numerics import Block, instrumented, plain
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.wind.force_bins import binned, drags, factor, forces, spans, width
from np_drake.diagnosis.wind.gauss_markov import Begins, WindForce
from np_drake.rigid_body import V

STILL = 0.02  # speed below which a vehicle goes no way [m/s]; own choice
FRICTION = 3  # its column, after three drags and before a mean force along each axis


def dry_friction(
    flights: Sequence[FlightResiduals], felt: Mapping[str, np.ndarray], begins: Begins, gusts: WindForce
) -> float:
    """Return the dry friction beside drag and gusts, in its standard deviations [1]; above 0: there is one.

    The lesser of two: gusts bias the estimate without instruments away from friction, and the other not at all.
    0 where nothing moves.
    felt: by flight, (m, 15) what drag and wind leave in it.   begins: by flight, when the wind begins [s].
    Source: `instruments`; that the friction has one size, whatever the speed: Coulomb's law.
    """
    blocks = list(_blocks(flights, felt, begins, gusts))
    return min(_against(*instrumented(blocks)), _against(*plain(blocks)))


def _against(precision: np.ndarray, target: np.ndarray) -> float:
    covariance = np.linalg.pinv(precision)
    variance = float(covariance[FRICTION, FRICTION])
    return float(-(covariance @ target)[FRICTION]) / np.sqrt(variance) if variance > 0.0 else 0.0


def _blocks(
    flights: Sequence[FlightResiduals], felt: Mapping[str, np.ndarray], begins: Begins, gusts: WindForce
) -> Iterator[Block]:
    for e in flights:
        both = np.hstack([forces(e, felt[e.name]), drags(e).reshape(-1, 9), _course(e)])
        for span in spans(e, both, begins.get(e.name)):
            f, units, course = span[:, :3], span[:, 3:12].reshape(-1, 3, 3), span[:, 12:]
            root = factor(len(span), width(e), *gusts.figures)
            for axis in range(3):
                mean = np.zeros((len(span), 3))
                mean[:, axis] = 1.0
                yield np.column_stack([units[:, axis], course[:, axis], mean]), f[:, axis], root


def _course(e: FlightResiduals) -> np.ndarray:
    """(k, 3) over bins, the unit vector in W along which a vehicle goes."""
    v = e.from_rows(e.rows.x[:, V])
    return binned(e, v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), STILL))
