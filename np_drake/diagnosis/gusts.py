"""Gusts as a cause: slow forces that act through the drag that was found, from their onset on.

The force is a first-order Gauss-Markov process under white noise, in residual forces that are
averaged over bins; a wind begins where gusts are likelier than sensor errors alone.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np
import scipy

from np_drake import attitude
from np_drake.diagnosis.fitting import refit
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import HALF_WIDTH_95, Options
from np_drake.diagnosis.regressors import DRAG, GUSTY, Model, Onset, switched
from np_drake.diagnosis.residuals import FORCE, FlightResiduals
from np_drake.diagnosis.result import Cause, Estimate
from np_drake.diagnosis.selection import Ranking, names_of, names_of_fit
from np_drake.diagnosis.selection.change_point import ONSET_EDGE
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag

WIND_BIN = 0.1  # over which the force is averaged, to a whole number of rows [s]
COVARIANCE_SPAN = 20.0  # what lies farther apart counts as independent [s]
# correlation time [s]
SHORTEST_TIME = 0.1
LONGEST_TIME = 20.0
CURVATURE_STEP = 0.02  # of the logarithms, for their curvature [1]


Begins = Mapping[str, float | None]  # by flight, when the wind begins [s]; None: from the start


@dc.dataclass(frozen=True)
class WindForce:
    """Force in W of a wind on a vehicle. mean (3, 2): axes by value and half width of the 95 %
    interval [N].

    deviation [N], correlation_time [s]: value, lower and upper end; of a first-order Gauss-Markov
    process. white: deviation of a bin's noise [N].
    """

    mean: np.ndarray
    deviation: tuple[float, float, float]
    correlation_time: tuple[float, float, float]
    white: float


def wind_force(
    flights: Sequence[FlightResiduals], residual: Mapping[str, np.ndarray], begins: Begins
) -> WindForce:
    """Return the wind force that a residual (m, 15) by flight shows from the begin of the wind on.

    Args:
        residual: by flight, (m, 15) what a model leaves of it.
        begins: by flight, when the wind begins [s]; None: from the start.
    Source: restricted maximum likelihood, the mean of each axis taken out; the intervals by its
        curvature in the
    logarithms. Deviation and correlation time are those of the two level axes together.
    """
    pieces = [s for e in flights for s in spans(e, forces(e, residual[e.name]), begins.get(e.name))]
    level = [span[:, :2] for span in pieces]
    size_of_bin = width(flights[0])
    size = float(np.sqrt(np.mean(np.concatenate(level).var(axis=0))))
    start = np.log([size, 1.0, 0.3 * size])
    bounds = [
        (start[0] - 4, start[0] + 3),
        (np.log(SHORTEST_TIME), np.log(LONGEST_TIME)),
        (start[0] - 6, start[0] + 1),
    ]

    def loss(z: np.ndarray) -> float:
        # Restricted likelihood: the mean, projected out of the whitened forces, costs
        # log(1'C^-1 1) / 2 an axis.
        F, one, logdet = whitened(level, size_of_bin, *np.exp(z))
        weight = one @ one
        power = np.sum(F**2) - np.sum((one @ F) ** 2) / weight
        return float(0.5 * (power + F.shape[1] * (logdet + np.log(weight))))

    best = scipy.optimize.minimize(loss, start, method="L-BFGS-B", bounds=bounds).x
    deviation, time, white = np.exp(best)
    # (k, k) second derivatives by central differences, with a weak prior: a figure may not
    # matter at all.
    E = CURVATURE_STEP * np.eye(len(best))

    def slope(z: np.ndarray) -> np.ndarray:
        return np.array([loss(z + e) - loss(z - e) for e in E]) / (2 * CURVATURE_STEP)

    H = np.array([slope(best + e) - slope(best - e) for e in E]) / (2 * CURVATURE_STEP)
    values, vectors = np.linalg.eigh(H)
    wide = np.exp(
        HALF_WIDTH_95
        * np.sqrt(np.diag(np.linalg.inv(vectors @ np.diag(np.maximum(values, 0.25)) @ vectors.T)))
    )
    F, one, _ = whitened(pieces, size_of_bin, deviation, time, white)
    mean = one @ F / (one @ one)  # generalised least squares, of variance 1 / (1'C^-1 1)
    return WindForce(
        np.stack([mean, np.full(3, HALF_WIDTH_95 / np.sqrt(one @ one))], axis=1),
        (float(deviation), float(deviation / wide[0]), float(deviation * wide[0])),
        (float(time), float(time / wide[1]), float(time * wide[1])),
        float(white),
    )


def whitened(
    pieces: Sequence[np.ndarray], size, deviation, time, white
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return forces (k, a) and ones (k,) whitened, all spans in a row, and the log determinant of
    their covariance.
    """
    # Whitening: with the Cholesky factor L of the covariance, L^-1 x has unit covariance.
    factors = {n: factor(n, size, deviation, time, white) for n in {len(s) for s in pieces}}
    both = [
        scipy.linalg.solve_triangular(
            factors[len(s)], np.column_stack([s, np.ones(len(s))]), lower=True
        )
        for s in pieces
    ]
    stacked = np.concatenate(both)
    return (
        stacked[:, :-1],
        stacked[:, -1],
        sum(2 * np.log(np.diag(factors[len(s)])).sum() for s in pieces),
    )


def forces(flight: FlightResiduals, residual: np.ndarray) -> np.ndarray:
    """Return (k, 3) the residual force in W averaged over bins [N], from a residual (m, 15).

    Args:
        residual: (m, 15) of the flight.
    """
    return binned(flight, attitude.rotate(flight.q, residual[:, FORCE]))


def drags(flight: FlightResiduals) -> np.ndarray:
    """Return (k, 3, 3) the force in W of a unit drag along each body axis (the last), averaged over
    bins [m/s].
    """
    return np.stack(
        [
            forces(flight, predicted_residual(flight, [Term(LinearDrag(*axis))]))
            for axis in np.eye(3).tolist()
        ],
        axis=-1,
    )


def binned(flight: FlightResiduals, values: np.ndarray) -> np.ndarray:
    """Return (k, a) the means over bins of values (m, a) on the grid.

    Args:
        values: (m, a) on the grid.
    """
    size = _size(flight)
    return values[: len(values) // size * size].reshape(-1, size, values.shape[1]).mean(axis=1)


def width(flight: FlightResiduals) -> float:
    """Return the width of a bin [s]."""
    return _size(flight) * flight.grid.step


def instants(flight: FlightResiduals) -> np.ndarray:
    """Return (k,) the times at which bins begin [s]."""
    return flight.t[0] + width(flight) * np.arange(len(flight.t) // _size(flight))


def spans(flight: FlightResiduals, values: np.ndarray, begin: float | None) -> list[np.ndarray]:
    """Return bins (k, a) of a flight from `begin` on [s] (None: from the start), in pieces of at
    most `COVARIANCE_SPAN`.

    Args:
        values: (k, a) of all bins.
        begin: [s]; None: from the start.
    """
    later = values[0 if begin is None else np.searchsorted(instants(flight), begin) :]
    most = round(COVARIANCE_SPAN / width(flight))
    return [later[i : i + most] for i in range(0, len(later), most) if len(later) - i > 1]


def factor(
    n: int, width: float, deviation: float, time: float, white: float, common: float = 0.0
) -> np.ndarray:
    """Return (n, n) the lower Cholesky factor of the covariance of n bins of an averaged
    Gauss-Markov process.

    Args:
        width: of a bin [s].
        deviation: of the process [N].
        time: its correlation time [s].
        white: deviation of a bin's noise [N].
        common: of what all bins share [N].
    Source: own derivation: the double integral of exp(-|t| / time) over bins.
    """
    b = width / time
    column = 2 * (np.cosh(b) - 1) / b**2 * np.exp(-np.arange(n) * b)
    column[0] = 2 * (b - 1 + np.exp(-b)) / b**2
    column = column * deviation**2 + common**2
    column[0] += white**2
    return scipy.linalg.cholesky(scipy.linalg.toeplitz(column), lower=True)


def _size(flight: FlightResiduals) -> int:
    return max(1, round(WIND_BIN / flight.grid.step))


LATE_BEGIN = 1.0  # of a flight, in which no begin is looked for [s]
LEAST_STILL = 2.0  # that is quiet at least before a wind whose begin is not known at all [s]
WIND_ROUNDS = 2  # of wind and its begins: at first it is that of all the flight
SIZES = (0.35, 0.5, 0.7, 1.0, 1.4, 2.0)  # of that error, in tolerances [1]; own choice
# of a bin's noise, in what bins differ by from their neighbours' line [1]; own choice
WHITES = 0.6, 0.8, 1.0


# When a wind begins [s] (None: from the start; infinite: not at all), and its -2 log likelihood.
Begin = tuple[float | None, float]


def wind_onset(
    flight: FlightResiduals,
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
    bins = forces(flight, residual)[:, :2]
    t = instants(flight)
    here = 0 if begin is None else int(np.argmin(np.abs(t - min(begin, t[-1]))))
    deviation = wind.deviation[0]
    time = wind.correlation_time[0]
    root = factor(len(t), width(flight), deviation, time, wind.white, deviation)
    # A stationary process is the same backwards: one solution has those from every bin to the last.
    loss = before + np.cumsum(_loss_of_bins((bins - wind.mean[:2, 0])[::-1], root))[::-1]
    near = (t > t[0] + (LEAST_STILL if begin is None else ONSET_EDGE)) & (t < t[-1] - LATE_BEGIN)
    tried = np.union1d(np.flatnonzero(near), [0, here])
    best = int(tried[np.argmin(loss[tried])])
    if loss[here] - loss[best] <= 2 * gain:
        return begin, float(loss[here])
    return (float(t[best]) if best else None), float(loss[best])


def onsets_of(
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    residuals: tuple[Mapping[str, np.ndarray], Mapping[str, np.ndarray]],
    known: Begins,
    wind: WindForce,
    options: Options,
) -> dict[str, Begin]:
    """Return the onset of a wind in every flight.

    Args:
        held_out: held-out flights: what acts throughout the others hardly begins late in these.
        residuals: by flight, (m, 15) what is left of it under the wind and before.
        known: by flight, known onsets [s]; None: from the start.
    """
    windy, still = residuals
    before = {
        flight.name: still_air_loss(flight, still[flight.name], wind, options)
        for flight in (*flights, *held_out)
    }

    def sought(flight: FlightResiduals, begin: float | None, gain: float) -> Begin:
        return wind_onset(flight, windy[flight.name], begin, wind, before[flight.name], gain)

    onsets = {
        flight.name: sought(flight, known.get(flight.name), options.priors.onset_gain)
        for flight in flights
    }
    late = any(at is not None for at, _ in onsets.values())
    gain = options.priors.onset_gain if late else options.priors.new_onset_gain
    return onsets | {
        flight.name: sought(flight, known.get(flight.name) if late else None, gain)
        for flight in held_out
    }


def still_air_loss(
    flight: FlightResiduals, residual: np.ndarray, wind: WindForce, options: Options
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
    bins = forces(flight, residual)[:, :2]
    if not options.tolerance.real:
        count = 2 * np.arange(len(bins))
        squares = np.sum(bins**2, axis=1)
        power = np.cumsum(squares) - squares
        noise = np.maximum(wind.white**2, power / np.maximum(count, 1))
        return power / noise + count * np.log(noise)
    size = flight.weight * options.tolerance.attitude
    drift, _ = options.priors.attitude_drift
    spread = options.priors.attitude_spread
    rough = np.sqrt(np.mean(np.diff(bins, 2, axis=0) ** 2) / 6)
    n = min(len(bins), round(COVARIANCE_SPAN / width(flight)))
    return np.min(
        [
            _still_air_loss_of(bins, factor(n, width(flight), s * size, drift, w * rough, size))
            + (np.log(s) / spread) ** 2
            for s in SIZES
            for w in WHITES
        ],
        axis=0,
    )


def _still_air_loss_of(bins: np.ndarray, root: np.ndarray) -> np.ndarray:
    """Return (k,) the loss of the bins before each; beyond the reach of the covariance they count
    as independent.
    """
    n = len(root)
    pieces = [bins[i : i + n] for i in range(0, len(bins), n)]
    loss = np.concatenate([_loss_of_bins(p, root[: len(p), : len(p)]) for p in pieces])
    return np.cumsum(loss) - loss


def _loss_of_bins(bins: np.ndarray, root: np.ndarray) -> np.ndarray:
    """Return (k,) the -2 log likelihood of each bin (k, 2) after those before it."""
    white = scipy.linalg.solve_triangular(root, bins, lower=True)
    return np.sum(white**2, axis=1) + 4 * np.log(np.diag(root))


WEAKEST = 1e-4  # level drag through which anything acts [N·s/m]; own choice
UPWARD = 0.5  # deviation of a mean wind upward: the ground is near [m/s]; own choice
STRONGEST = next(p.upper for p in GustyWind.parameters if p.name == "deviation")  # of gusts [m/s]


def as_gusts(
    flights: Sequence[FlightResiduals],
    through_drag: Mapping[str, np.ndarray],
    causes: list[Cause],
    probability: float,
    options: Options,
    held_out: Sequence[FlightResiduals] = (),
) -> list[Cause]:
    """Return the causes with gusts among them, where a drag was found through which they can act.

    A steady wind among the causes becomes the mean of the gusts.

    Args:
        through_drag: by flight, (m, 15) what drag and wind together leave in it.
        probability: of gusts [1].
        held_out: held-out flights, in which the wind may begin as well.
    """
    drag = next((c for c in causes if c.identifier == DRAG), None)
    if drag is None:
        return causes
    steady = next((c.onset for c in causes if c.identifier in GUSTY[1:]), {})
    known = {
        name: steady.get(name) if begin is None else begin for name, begin in drag.onset.items()
    }
    if not any(spans(e, instants(e)[:, None], known.get(e.name)) for e in flights):  # too few bins
        return causes
    onset, begun = _onsets(flights, held_out, through_drag, drag, known, options)
    drag = dc.replace(drag, onset=dict(begun))
    # A wind acts through a drag that is physical, and not negligible.
    drag_effect = drag.effect
    if (
        not isinstance(drag_effect, LinearDrag)
        or 0.5 * (drag_effect.d_x + drag_effect.d_y) <= WEAKEST
        or not all(p.lower <= drag_effect.values[p.name] <= p.upper for p in drag_effect.parameters)
    ):
        return causes
    force = wind_force(flights, _without_drag(flights, through_drag, drag_effect, begun), onset)
    # Stronger than winds are, even through the largest drag of the interval, they are none.
    most = STRONGEST * np.mean(
        [max(map(abs, drag.parameters[name].ci95)) for name in ("d_x", "d_y")]
    )
    if not options.materiality.force * flights[0].weight <= force.deviation[0] <= most:
        return causes
    parameters = _statistics(flights, force, drag, options)
    gusts = Cause(
        GustyWind.identifier,
        probability,
        parameters,
        dict(onset),
        (),
        effect=GustyWind.of({name: e.value for name, e in parameters.items()}),
    )
    return [
        *(drag if c.identifier == DRAG else c for c in causes if c.identifier not in GUSTY[1:]),
        gusts,
    ]


def _without_drag(
    flights: Sequence[FlightResiduals],
    through_drag: Mapping[str, np.ndarray],
    drag: LinearDrag,
    begins: Begins,
) -> dict[str, np.ndarray]:
    """Return by flight (m, 15) what the wind pushes through the drag, without the drag itself,
    which acts from its begin on.
    """
    terms = [Term(drag, dict(begins))]
    return {
        flight.name: through_drag[flight.name] - predicted_residual(flight, terms)
        for flight in flights
    }


def _statistics(
    flights: Sequence[FlightResiduals], force: WindForce, drag: Cause, options: Options
) -> dict[str, Estimate]:
    """Return the wind's parameters [m/s, s] from those of its force, as uncertain as the drag and
    the sensors' axes.
    """
    d = np.array([drag.parameters[f"d_{axis}"].value for axis in "xyz"])
    d[np.abs(d) < 1e-6] = 1e-6  # avoids a division by zero [N·s/m]
    level = float(np.abs(d[:2]).mean())
    known = max(drag.parameters[f"d_{axis}"].half for axis in "xy") / level
    tolerance = options.tolerance
    tilt = tolerance.attitude / np.sqrt(len(flights))
    off = (
        flights[0].weight
        * HALF_WIDTH_95
        * np.array([tilt, tilt, np.hypot(tolerance.mass, tolerance.thrust)])
    )
    out = {}
    for i, p in enumerate(GustyWind.parameters[:3]):
        half = float(np.hypot(force.mean[i, 1], off[i])) / abs(d[i])
        usual = UPWARD if p.name == "mean_z" else p.typical
        shrinkage = usual**2 / (usual**2 + (half / HALF_WIDTH_95) ** 2)
        value = shrinkage * force.mean[i, 0] / d[i]
        half = float(np.hypot(np.sqrt(shrinkage) * half, known * value))
        out[p.name] = Estimate(float(value), "m/s", (float(value) - half, float(value) + half))
    value, lower, upper = force.deviation
    wider = [float(np.exp(np.hypot(np.log(end / value), known))) for end in (lower, upper)]
    out["deviation"] = Estimate(
        value / level, "m/s", (value / level / wider[0], value / level * wider[1])
    )
    time, lower, upper = force.correlation_time
    out["correlation_time"] = Estimate(time, "s", (lower, upper))
    return out


def _onsets(
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    through_drag: Mapping[str, np.ndarray],
    drag: Cause,
    known: Begins,
    options: Options,
) -> tuple[Begins, Begins]:
    """Return by flight when the wind begins [s], given the `known` onsets, and when the drag does.

    A drag that begins with the wind in one flight does so in all. Flights of the fit say whether it
    does: what a held-out one seems to show moves nothing in them.
    """
    acts = drag.onset
    effect = drag.effect
    assert isinstance(effect, LinearDrag)
    windy = _without_drag([*flights, *held_out], through_drag, effect, {})
    at_once = (
        2
        * options.priors.onset_gain
        * any(drag.onset.get(flight.name) is not None for flight in flights)
    )
    for _ in range(WIND_ROUNDS):
        residuals = _without_drag(flights, through_drag, effect, acts)
        wind = wind_force(flights, residuals, known)
        apart, together = (
            onsets_of(flights, held_out, (windy, still), known, wind, options)
            for still in (windy, through_drag)
        )
        late = [
            flight
            for flight in flights
            if any(b[flight.name][0] is not None for b in (apart, together))
        ]
        both = (
            at_once
            + sum(apart[flight.name][1] - together[flight.name][1] for flight in late or held_out)
            > 0
        )
        known = {name: at for name, (at, _) in (together if both else apart).items()}
        acts = known if both else drag.onset
    return known, acts


def with_drag(ranking: Ranking) -> Ranking:
    """Return the ranking with a linear drag in the named model, where flights do not speak against
    it.

    The prior of the drag is that of generic structure. Where the slow force begins in flight, so
    may the drag.
    """
    priors = ranking.options.priors
    problem = ranking.problem
    key = names_of_fit(ranking.best)
    known = next((m for m in ranking.models if names_of(problem, m) == key), None)
    if known is None or DRAG in key:
        return ranking
    drags = [
        i for i, c in enumerate(problem.candidates) if c.identifiers == (DRAG,) and not c.onset
    ]
    # The slow force that is left may begin in flight: its own power pays for instants.
    residual = {flight.name: ranking.best.residual(flight) for flight in problem.flights}
    begins: Begins = {}
    for _ in range(WIND_ROUNDS):
        wind = wind_force(problem.flights, residual, begins)
        onsets = onsets_of(problem.flights, [], (residual, residual), begins, wind, ranking.options)
        begins = {name: at for name, (at, _) in onsets.items()}
    onset: Onset = {name: begin for name, begin in begins.items() if begin is not None}
    if onset:
        late = [switched(problem.candidates[i], problem.flights, onset) for i in drags]
        drags += [len(problem.candidates) + k for k in range(len(late))]
        problem = problem.extended(late)
    sets = [(*known.members, i) for i in drags if problem.fits_together((*known.members, i))]
    best = max((Model(m, problem.score(m)) for m in sets), key=lambda m: m.score, default=None)
    if best is None:
        return ranking
    odds = best.score - problem.score(known.members) - priors.of_effect(DRAG) + priors.generic
    if odds < 0:
        return ranking

    return dc.replace(
        ranking,
        fits=(refit(problem, best, None, ranking.noise), *ranking.fits),
        problem=problem,
        models=(best, *ranking.models),
        probability=ranking.probability | {DRAG: float(1 / (1 + np.exp(-odds)))},
    )


def residuals_of(ranking: Ranking, held_out: HeldOut) -> dict[str, np.ndarray]:
    """Return by flight the residual (m, 15) of the best model [N, N·m, …]."""
    rest = {flight.name: ranking.best.residual(flight) for flight in ranking.problem.flights}
    return rest | {flight.name: held_out.swing_free_residual(flight) for flight in held_out.flights}


def with_gusts(
    ranking: Ranking, held_out: HeldOut, causes: list[Cause], probability: float
) -> list[Cause]:
    """Return the causes with gusts among them, where a drag was found through which they act."""
    flights = ranking.problem.flights
    through_drag = residuals_of(ranking, held_out)
    for flight in (*flights, *held_out.flights):
        terms = [
            t
            for t in held_out.terms.get(flight.name, ranking.best.terms)
            if t.effect.identifier in GUSTY
        ]
        through_drag[flight.name] = through_drag[flight.name] + predicted_residual(flight, terms)
    return as_gusts(flights, through_drag, causes, probability, ranking.options, held_out.flights)


def in_gusts(held_out: HeldOut, causes: Sequence[Cause]) -> HeldOut:
    """Return the held-out flights with the mean of the gusts in the place of a steady wind.

    causes: the gusts and the drag through which they act among them, each from when on it acts.
    """
    by_name = {c.identifier: c for c in causes}
    gusts = by_name[GustyWind.identifier]
    drag = by_name[DRAG]
    assert gusts.effect is not None
    assert drag.effect is not None
    terms = dict(held_out.terms)
    residual = dict(held_out.residual)
    for flight in held_out.flights:
        kept = held_out.terms[flight.name][: held_out.effects]
        given = held_out.terms[flight.name][held_out.effects :]
        rest = [t for t in kept if t.effect.identifier not in GUSTY]
        terms[flight.name] = [
            *rest,
            Term(drag.effect, {flight.name: drag.onset.get(flight.name)}),
            Term(gusts.effect.predicted, {flight.name: gusts.onset.get(flight.name)}),
            *given,
        ]
        residual[flight.name] = flight.y - predicted_residual(flight, terms[flight.name])
    return dc.replace(held_out, terms=terms, residual=residual, effects=len(rest) + 2)
