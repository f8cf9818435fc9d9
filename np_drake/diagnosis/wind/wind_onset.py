"""Onset of a wind: the instant from which gusts are likelier than sensor errors alone."""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import linalg

from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.selection.change_point import EDGE
from np_drake.diagnosis.wind.gauss_markov import (
    SPAN,
    Begins,
    WindForce,
    factor,
    forces,
    instants,
    width,
    wind_force,
)

LAST = 1.0  # of a flight, in which no begin is looked for [s]
LEAST_STILL = 2.0  # that is quiet at least before a wind whose begin is not known at all [s]
ROUNDS = 2  # of wind and its begins: at first it is that of all the flight
SIZES = (0.35, 0.5, 0.7, 1.0, 1.4, 2.0)  # of that error, in tolerances [1]; own choice
WHITES = (
    0.6,
    0.8,
    1.0,
)  # of a bin's noise, in what bins differ by from their neighbours' line [1]; own choice


@dc.dataclass(frozen=True)
class Begin:
    """When the wind begins [s] (None: from the start; infinite: not at all), and its -2 log
    likelihood.
    """

    at: float | None
    loss: float


def wind_onset(
    e: FlightResiduals,
    residual: np.ndarray,
    begin: float | None,
    wind: WindForce,
    before: np.ndarray,
    gain: float,
) -> Begin:
    """Return when the wind begins, given a known onset [s] (None: from the start; infinite: not at
    all).

    Gusts show by their power at once. What was known stays where a better one brings less than
    `gain`.

    Args:
        residual: (m, 15) what is left of the flight under the wind.
        begin: known onset [s]; None: from the start; infinite: not at all.
        before: (k,) `still_air_loss` of what is left until then.
        gain: least log likelihood that a better onset must bring.
    Source: likelihood of a change point; the two sides independent (own choice).
    """
    bins, t = forces(e, residual)[:, :2], instants(e)
    k = np.arange(len(t))
    here = 0 if begin is None else int(np.argmin(np.abs(t - min(begin, t[-1]))))
    root = factor(len(t), width(e), *wind.figures, wind.deviation[0])
    # A stationary process is the same backwards: one solution has those from every bin to the last.
    loss = before + np.cumsum(_loss_of_bins((bins - wind.mean[:2, 0])[::-1], root))[::-1]
    near = (t > t[0] + (LEAST_STILL if begin is None else EDGE)) & (t < t[-1] - LAST)
    tried = np.union1d(k[near], [0, here])
    best = int(tried[np.argmin(loss[tried])])
    if loss[here] - loss[best] <= 2 * gain:
        return Begin(begin, float(loss[here]))
    return Begin(float(t[best]) if best else None, float(loss[best]))


def wind_begins(
    flights: Sequence[FlightResiduals],
    residual: Mapping[str, np.ndarray],
    known: Begins,
    options: Options,
) -> Begins:
    """Return by flight when the wind begins by its own power [s], given known onsets and residuals
    (m, 15).

    Args:
        residual: by flight, (m, 15) what a model leaves of it.
        known: by flight, known onsets [s]; None: from the start.
    """
    for _ in range(ROUNDS):
        wind = wind_force(flights, residual, known)
        known = {
            name: begin.at
            for name, begin in onsets_of(
                flights, [], (residual, residual), known, wind, options
            ).items()
        }
    return known


def onsets_of(
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    left: tuple[Mapping[str, np.ndarray], Mapping[str, np.ndarray]],
    known: Begins,
    wind: WindForce,
    options: Options,
) -> dict[str, Begin]:
    """Return the onset of a wind in every flight.

    Args:
        held_out: held-out flights: what acts throughout the others hardly begins late in these.
        left: by flight, (m, 15) what is left of it under the wind and before.
        known: by flight, known onsets [s]; None: from the start.
    """
    windy, still = left
    before = {
        e.name: still_air_loss(e, still[e.name], wind, options) for e in (*flights, *held_out)
    }

    def sought(e: FlightResiduals, begin: float | None, gain: float) -> Begin:
        return wind_onset(e, windy[e.name], begin, wind, before[e.name], gain)

    found = {e.name: sought(e, known.get(e.name), options.priors.onset_gain) for e in flights}
    late = any(begin.at is not None for begin in found.values())
    gain = options.priors.onset_gain if late else options.priors.new_onset_gain
    return found | {e.name: sought(e, known.get(e.name) if late else None, gain) for e in held_out}


def still_air_loss(
    e: FlightResiduals, residual: np.ndarray, wind: WindForce, options: Options
) -> np.ndarray:
    """Return (k,) the -2 log likelihood of the level forces in the bins before each bin, without a
    wind.

    Ideal sensors leave white noise. A real attitude errs slowly as well, a Gauss-Markov process
    about the tolerance in
    size, whichever fits best.   Source: profile likelihood; own choice of the grid.

    Args:
        residual: (m, 15) what is left of the flight in still air.
        wind: statistics of the wind's force, for its white noise.
    """
    bins = forces(e, residual)[:, :2]
    if not options.tolerance.real:
        count = 2 * np.arange(len(bins))
        power = _before(np.sum(bins**2, axis=1))
        noise = np.maximum(wind.white**2, power / np.maximum(count, 1))
        return power / noise + count * np.log(noise)
    size = e.weight * options.tolerance.attitude
    (drift, _), spread = options.priors.attitude_drift, options.priors.attitude_spread
    rough = np.sqrt(np.mean(np.diff(bins, 2, axis=0) ** 2) / 6)
    n = min(len(bins), round(SPAN / width(e)))
    losses = [
        _still_air_loss_of(bins, factor(n, width(e), s * size, drift, w * rough, size))
        + (np.log(s) / spread) ** 2
        for s in SIZES
        for w in WHITES
    ]
    return np.min(losses, axis=0)


def _still_air_loss_of(bins: np.ndarray, root: np.ndarray) -> np.ndarray:
    """Return (k,) the loss of the bins before each; beyond the reach of the covariance they count
    as independent.
    """
    n = len(root)
    pieces = [bins[i : i + n] for i in range(0, len(bins), n)]
    return _before(np.concatenate([_loss_of_bins(p, root[: len(p), : len(p)]) for p in pieces]))


def _loss_of_bins(bins: np.ndarray, root: np.ndarray) -> np.ndarray:
    """Return (k,) the -2 log likelihood of each bin (k, 2) after those before it."""
    white = linalg.solve_triangular(root, bins, lower=True)
    return np.sum(white**2, axis=1) + 4 * np.log(np.diag(root))


def _before(values: np.ndarray) -> np.ndarray:
    """Return (k,) the sums of the values before each."""
    return np.concatenate([[0.0], np.cumsum(values)[:-1]])
