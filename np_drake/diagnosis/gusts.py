"""Gusts as a cause: a slow force that acts through the drag that was found, from its onset on."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
import scipy

from np_drake.diagnosis.fitting import refit
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import HALF_WIDTH_95, Options
from np_drake.diagnosis.regressors import DRAG, GUSTY, Model, switched
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause, Estimate
from np_drake.diagnosis.selection import Ranking, names_of, names_of_fit
from np_drake.diagnosis.selection.change_point import ONSET_EDGE
from np_drake.diagnosis.slow_force import (
    Onsets,
    Residuals,
    WindForce,
    forces,
    instants,
    since,
    width,
    wind_force,
)
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag

LATE_ONSET = 1.0  # of a flight, in which no onset is looked for [s]
LEAST_STILL = 2.0  # that is quiet at least before a wind of whose onset nothing is known [s]
ROUNDS = 2  # of wind and its onsets: at first it is that of all the flight


def wind_onset(
    flight: FlightResiduals,
    windy: np.ndarray,
    still: np.ndarray,
    wind: WindForce,
    known: float | None,
    gain: float,
) -> tuple[float | None, float]:
    """Return the onset of the wind, given a known one [s] (None: from the start; infinite: not at
    all), and the -2 log likelihood.

    Gusts show by their power at once. What was known stays where a better one brings less than
    `gain`.

    Args:
        windy, still: (m, 15) what is left of the flight under the wind and before.
    Source: likelihood of a change point; the two sides independent (own choice).
    """
    t = instants(flight)
    step = width(flight)
    after = forces(flight, windy)[:, :2] - wind.mean[:2, 0]
    before = forces(flight, still)[:, :2]
    here = 0 if known is None else int(np.argmin(np.abs(t - min(known, t[-1]))))
    near = (t > t[0] + (LEAST_STILL if known is None else ONSET_EDGE)) & (t < t[-1] - LATE_ONSET)
    loss = {
        int(k): wind.loss(before[:k], step, blows=False) + wind.loss(after[k:], step, blows=True)
        for k in (here, 0, *np.flatnonzero(near))
    }
    best = min(loss, key=loss.__getitem__)
    if loss[here] - loss[best] <= 2 * gain:
        return known, loss[here]
    return (float(t[best]) if best else None), loss[best]


@dc.dataclass(frozen=True)
class WindOnsets:
    """Onset [s] of a wind by flight, and the -2 log likelihood of the flight with it."""

    onsets: Onsets
    loss: dict[str, float]


def onsets_of(
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    windy: Residuals,
    still: Residuals,
    known: Onsets,
    options: Options,
) -> WindOnsets:
    """Return the onset of a wind in every flight.

    Args:
        held_out: held-out flights: what acts throughout the others hardly begins late in these.
        windy, still: what is left of a flight under the wind and before.
        known: by flight, known onsets [s]; None: from the start.
    """
    priors = options.priors
    for _ in range(ROUNDS):
        wind = wind_force(flights, windy, known, options)
        likeliest = {
            flight.name: wind_onset(
                flight,
                windy[flight.name],
                still[flight.name],
                wind,
                known.get(flight.name),
                priors.onset_gain,
            )
            for flight in flights
        }
        late = any(onset is not None for onset, _ in likeliest.values())
        for flight in held_out:
            name = flight.name
            likeliest[name] = wind_onset(
                flight,
                windy[name],
                still[name],
                wind,
                known.get(name) if late else None,
                priors.onset_gain if late else priors.new_onset_gain,
            )
        known = {name: onset for name, (onset, _) in likeliest.items()}
    return WindOnsets(known, {name: loss for name, (_, loss) in likeliest.items()})


WEAKEST = 1e-4  # level drag through which anything acts [N·s/m]; own choice
UPWARD = 0.5  # deviation of a mean wind upward: the ground is near [m/s]; own choice
STRONGEST = next(p.upper for p in GustyWind.parameters if p.name == "deviation")  # of gusts [m/s]


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
    wind = onsets_of(problem.flights, [], residual, residual, {}, ranking.options)
    onset: Onsets = {name: at for name, at in wind.onsets.items() if at is not None}
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
        probability=ranking.probability | {DRAG: float(scipy.special.expit(odds))},
    )


def as_gusts(
    flights: Sequence[FlightResiduals],
    through_drag: Residuals,
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
    effect = drag and drag.effect
    # A wind acts through a drag that is physical, and not negligible.
    if (
        drag is None
        or not isinstance(effect, LinearDrag)
        or 0.5 * (effect.d_x + effect.d_y) <= WEAKEST
        or not all(p.lower <= effect.values[p.name] <= p.upper for p in effect.parameters)
    ):
        return causes
    steady = next((c.onset for c in causes if c.identifier in GUSTY[1:]), {})
    known = {n: steady.get(n) if onset is None else onset for n, onset in drag.onset.items()}
    if not any(len(since(e, instants(e), known.get(e.name))) > 1 for e in flights):
        return causes
    every = [*flights, *held_out]
    windy = {
        flight.name: through_drag[flight.name] - predicted_residual(flight, [Term(effect)])
        for flight in every
    }
    # The drag acts throughout, or begins with the wind: flights of the fit decide which, where the
    # wind begins late in one.
    apart, together = (
        onsets_of(flights, held_out, windy, still, known, options)
        for still in (windy, through_drag)
    )
    late = any(w.onsets[e.name] is not None for w in (apart, together) for e in flights)
    judges = [e.name for e in (flights if late else every)]
    at_once = any(drag.onset.get(flight.name) is not None for flight in flights)
    gain = sum(apart.loss[name] - together.loss[name] for name in judges)
    if gain + 2 * options.priors.onset_gain * at_once > 0:
        onset = together.onsets
        drag = dc.replace(drag, onset=onset)
    else:
        onset = apart.onsets
    force = wind_force(flights, windy, onset, options)
    # Stronger than winds are, even through the largest drag of the interval, they are none.
    largest = np.mean([max(map(abs, drag.parameters[n].ci95)) for n in ("d_x", "d_y")])
    least = options.materiality.force * flights[0].weight
    if not least <= force.deviation[0] <= STRONGEST * largest:
        return causes
    parameters = _statistics(flights, force, drag, options)
    gusts = GustyWind.of({name: e.value for name, e in parameters.items()})
    return [
        *(drag if c.identifier == DRAG else c for c in causes if c.identifier not in GUSTY[1:]),
        Cause(GustyWind.identifier, probability, parameters, dict(onset), (), effect=gusts),
    ]


def _statistics(
    flights: Sequence[FlightResiduals], force: WindForce, drag: Cause, options: Options
) -> dict[str, Estimate]:
    """Return the wind's parameters [m/s, s] from those of its force, as uncertain as the drag and
    the sensors' axes.
    """
    tolerance = options.tolerance
    d = np.array([drag.parameters[f"d_{axis}"].value for axis in "xyz"])
    d[np.abs(d) < 1e-6] = 1e-6  # avoids a division by zero [N·s/m]
    level = float(np.abs(d[:2]).mean())
    known = max(drag.parameters[f"d_{axis}"].half for axis in "xy") / level
    tilt = tolerance.attitude / np.sqrt(len(flights))
    axes = np.array([tilt, tilt, np.hypot(tolerance.mass, tolerance.thrust)])
    spread = np.hypot(force.mean[:, 1] / HALF_WIDTH_95, flights[0].weight * axes) / np.abs(d)
    usual = np.array([*(p.typical for p in GustyWind.parameters[:2]), UPWARD])
    shrinkage = usual**2 / (usual**2 + spread**2)
    mean = shrinkage * force.mean[:, 0] / d
    half = np.hypot(HALF_WIDTH_95 * np.sqrt(shrinkage) * spread, known * mean)
    deviation = force.deviation[0] / level
    wider = np.exp(np.hypot(np.log(force.deviation[2] / force.deviation[0]), known))
    return {
        **{
            f"mean_{axis}": Estimate(float(m), "m/s", (float(m - h), float(m + h)))
            for axis, m, h in zip("xyz", mean, half, strict=True)
        },
        "deviation": Estimate(deviation, "m/s", (deviation / wider, deviation * wider)),
        "correlation_time": Estimate(force.time[0], "s", force.time[1:]),
    }


def in_gusts(held_out: HeldOut, causes: Sequence[Cause]) -> HeldOut:
    """Return the held-out flights with the mean of the gusts in the place of a steady wind.

    causes: the gusts and the drag through which they act among them, each from when on it acts.
    """
    by_name = {c.identifier: c for c in causes}
    gusts = by_name[GustyWind.identifier]
    drag = by_name[DRAG]
    assert gusts.effect is not None
    assert drag.effect is not None
    terms = {}
    for flight in held_out.flights:
        now = held_out.terms[flight.name]
        kept = [t for t in now[: held_out.effects] if t.effect.identifier not in GUSTY]
        blown = [
            Term(drag.effect, {flight.name: drag.onset.get(flight.name)}),
            Term(gusts.effect.predicted, {flight.name: gusts.onset.get(flight.name)}),
        ]
        terms[flight.name] = [*kept, *blown, *now[held_out.effects :]]
    residual = {f.name: f.y - predicted_residual(f, terms[f.name]) for f in held_out.flights}
    return dc.replace(held_out, terms=terms, residual=residual, effects=len(kept) + len(blown))
