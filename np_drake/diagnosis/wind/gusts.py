"""Gusts as a cause: slow forces that no effect explains, felt through the drag that was found.

Gusts have no shape that a held-out flight would repeat; what tells them is that sensors alone do not make such a force
(`slow_force`). What is tied to a place, the command or the motion is asked about first (`unknown`).
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import DRAG, GUSTY
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause, Estimate
from np_drake.diagnosis.wind.force_bins import blows, drag_trace
from np_drake.diagnosis.wind.gauss_markov import WindForce, Z, wind_force
from np_drake.diagnosis.wind.joint_onset import GustOnset
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag

TINY = 1e-6  # drag that is none [N·s/m]
WEAKEST = 1e-4  # level drag that feels anything [N·s/m]; own choice
UPWARD = 0.5  # deviation of a mean wind upward: the ground is near [m/s]; own choice
STRONGEST = next(p.upper for p in GustyWind.parameters if p.name == "deviation")  # of gusts [m/s]


def as_gusts(
    flights: Sequence[FlightResiduals],
    felt: Mapping[str, np.ndarray],
    causes: list[Cause],
    probability: float,
    options: Options,
    held_out: Sequence[FlightResiduals] = (),
) -> list[Cause]:
    """Return the causes with gusts among them, where a drag was found through which they can act.

    felt: by flight, (m, 15) what drag and wind together leave in it: in those of which the parameters are, and in
    held-out ones, in which the wind may begin as well. A steady wind among the causes becomes the mean of the gusts.
    Gusts do not repeat: they explain no held-out flight. Stronger than a wind can be they are none.
    """
    drag = next((c for c in causes if c.identifier == DRAG), None)
    if drag is None:
        return causes
    known = _known(causes, drag)
    if not any(blows(e, known.get(e.name)) for e in flights):
        return causes
    onset, begun = GustOnset(flights, held_out, felt, drag, options).begins(known)
    drag = dc.replace(drag, onset=begun)
    if not isinstance(drag.effect, LinearDrag) or not _feels(drag.effect):
        return causes
    residual = {e.name: felt[e.name] - drag_trace(e, drag.effect, begun) for e in flights}
    force = wind_force(flights, residual, onset)
    if _too_strong(force, drag):
        return causes
    weight = flights[0].vehicle.mass * flights[0].vehicle.gravity
    if force.deviation[0] < options.materiality.force * weight:
        return causes
    parameters = _statistics(flights, force, drag, options)
    effect = GustyWind.of({name: e.value for name, e in parameters.items()})
    gusts = Cause(GustyWind.identifier, probability, parameters, onset, (), effect=effect)
    others = [c for c in causes if c.identifier not in GUSTY[1:]]
    return [*(drag if c.identifier == DRAG else c for c in others), gusts]


def _feels(drag: LinearDrag) -> bool:
    """Return whether a wind acts through this drag: physical, and not negligible."""
    inside = all(p.lower <= drag.values[p.name] <= p.upper for p in LinearDrag.parameters)
    return inside and 0.5 * (drag.d_x + drag.d_y) > WEAKEST


def _too_strong(force: WindForce, drag: Cause) -> bool:
    """Return whether the wind would vary more than winds do even through the largest drag of the interval."""
    most = np.mean([max(map(abs, drag.parameters[name].ci95)) for name in ("d_x", "d_y")])
    return bool(force.deviation[0] > STRONGEST * most)


def _known(causes: Sequence[Cause], drag: Cause) -> dict[str, float | None]:
    """By flight, when the wind begins as the causes have it: with its drag, or a steady wind's own begin."""
    steady = next((c.onset for c in causes if c.identifier in GUSTY[1:]), {})
    return {name: steady.get(name) if begin is None else begin for name, begin in drag.onset.items()}


def _statistics(
    flights: Sequence[FlightResiduals], force: WindForce, drag: Cause, options: Options
) -> dict[str, Estimate]:
    """Parameters of the wind [m/s, s] from those of its force, as uncertain as the drag and the sensors' axes."""
    d = np.array([drag.parameters[f"d_{axis}"].value for axis in "xyz"])
    d[np.abs(d) < TINY] = TINY
    level = float(np.abs(d[:2]).mean())
    known = max(_half(drag.parameters[f"d_{axis}"]) for axis in "xy") / level
    tolerance = options.tolerance
    weight = flights[0].vehicle.mass * flights[0].vehicle.gravity
    tilt = tolerance.attitude / np.sqrt(len(flights))
    off = weight * Z * np.array([tilt, tilt, np.hypot(tolerance.mass, tolerance.thrust)])
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
    out["deviation"] = Estimate(value / level, "m/s", (value / level / wider[0], value / level * wider[1]))
    time, lower, upper = force.correlation_time
    out["correlation_time"] = Estimate(time, "s", (lower, upper))
    return out


def _half(estimate: Estimate) -> float:
    return 0.5 * (estimate.ci95[1] - estimate.ci95[0])
