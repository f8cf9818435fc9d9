"""Gusts as a cause: slow forces that no effect explains, which act through the drag that was
found.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.diagnosis.fitting import refit
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import DRAG, GUSTY, Model, Onset, switched
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause, Estimate
from np_drake.diagnosis.selection import Ranking, names_of, names_of_fit
from np_drake.diagnosis.wind.gauss_markov import Begins, WindForce, Z, instants, spans, wind_force
from np_drake.diagnosis.wind.wind_onset import ROUNDS, onsets_of, wind_begins
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag

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
    if not isinstance(drag.effect, LinearDrag) or not _acts_through(drag.effect):
        return causes
    force = wind_force(
        flights,
        {e.name: _without_drag(through_drag[e.name], e, drag.effect, begun) for e in flights},
        onset,
    )
    # Stronger than winds are, even through the largest drag of the interval, they are none.
    most = STRONGEST * float(
        np.mean([max(map(abs, drag.parameters[name].ci95)) for name in ("d_x", "d_y")])
    )
    if not options.materiality.force * flights[0].weight <= force.deviation[0] <= most:
        return causes
    parameters = _statistics(flights, force, drag, options)
    effect = GustyWind.of({name: e.value for name, e in parameters.items()})
    gusts = Cause(GustyWind.identifier, probability, parameters, dict(onset), (), effect=effect)
    others = [c for c in causes if c.identifier not in GUSTY[1:]]
    return [*(drag if c.identifier == DRAG else c for c in others), gusts]


def _acts_through(drag: LinearDrag) -> bool:
    """Return whether a wind acts through this drag: physical, and not negligible."""
    inside = all(p.lower <= drag.values[p.name] <= p.upper for p in LinearDrag.parameters)
    return inside and 0.5 * (drag.d_x + drag.d_y) > WEAKEST


def _without_drag(
    through_drag: np.ndarray, e: FlightResiduals, drag: LinearDrag, begins: Begins
) -> np.ndarray:
    """Return (m, 15) what the wind pushes through the drag, without the drag itself, which acts
    from its begin on.
    """
    return through_drag - predicted_residual(e, [Term(drag, {e.name: begins.get(e.name)})])


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
    off = flights[0].weight * Z * np.array([tilt, tilt, np.hypot(tolerance.mass, tolerance.thrust)])
    out = {}
    for i, p in enumerate(GustyWind.parameters[:3]):
        half = float(np.hypot(force.mean[i, 1], off[i])) / abs(d[i])
        usual = UPWARD if p.name == "mean_z" else p.typical
        told = usual**2 / (usual**2 + (half / Z) ** 2)
        value = told * force.mean[i, 0] / d[i]
        half = float(np.hypot(np.sqrt(told) * half, known * value))
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
    acts, effect = drag.onset, drag.effect
    assert isinstance(effect, LinearDrag)
    windy = {
        e.name: _without_drag(through_drag[e.name], e, effect, {}) for e in (*flights, *held_out)
    }
    at_once = (
        2 * options.priors.onset_gain * any(drag.onset.get(e.name) is not None for e in flights)
    )
    for _ in range(ROUNDS):
        left = {e.name: _without_drag(through_drag[e.name], e, effect, acts) for e in flights}
        wind = wind_force(flights, left, known)
        apart, together = (
            onsets_of(flights, held_out, (windy, still), known, wind, options)
            for still in (windy, through_drag)
        )
        late = [e for e in flights if any(b[e.name].at is not None for b in (apart, together))]
        gain = sum(apart[e.name].loss - together[e.name].loss for e in late or held_out)
        both = gain + at_once > 0
        known = {name: begin.at for name, begin in (together if both else apart).items()}
        acts = known if both else drag.onset
    return known, acts


def with_drag(ranking: Ranking) -> Ranking:
    """Return the ranking with a linear drag in the named model, where flights do not speak against
    it.

    The prior of the drag is that of generic structure. Where the slow force begins in flight, so
    may the drag.
    """
    priors, problem, key = ranking.options.priors, ranking.problem, names_of_fit(ranking.best)
    known = next((m for m in ranking.models if names_of(problem, m) == key), None)
    if known is None or DRAG in key:
        return ranking
    drags = [
        i for i, c in enumerate(problem.candidates) if c.identifiers == (DRAG,) and not c.onset
    ]
    # The slow force that is left may begin in flight: its own power pays for instants.
    left = {e.name: ranking.best.residual(e) for e in problem.flights}
    begins = wind_begins(problem.flights, left, {}, ranking.options)
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
    named = refit(problem, best, None, ranking.noise)
    probability = ranking.probability | {DRAG: float(1 / (1 + np.exp(-odds)))}
    fits, models = (named, *ranking.fits), (best, *ranking.models)
    return dc.replace(ranking, fits=fits, problem=problem, models=models, probability=probability)
