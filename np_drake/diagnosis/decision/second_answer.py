"""Second answer: first halves of held-out flights join the fit where they show what training flights do not.

The second halves alone judge it.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.adequacy import novel_on_held_out, swing_free_residual
from np_drake.diagnosis.decision.infer import Inference, concluded
from np_drake.diagnosis.held_out import misfit
from np_drake.diagnosis.residuals import FlightResiduals, make_flight_residuals
from np_drake.diagnosis.result import CHANNELS, Cause, Finding
from np_drake.diagnosis.selection import PAYLOAD, find_map_model
from np_drake.diagnosis.wind import slow_power

NAME = "first half of {}"


def novelty(first: Inference) -> tuple[Finding, ...]:
    """Return what held-out flights show that training flights do not, a sentence each.

    Gusts, which repeat nowhere, and a payload, whose swing may be lost, do not count.
    """
    ranking, options = first.ranking, first.options
    if any(c.identifier == "gusty_wind" for c in first.causes) or any(t.swings for t in ranking.best.terms):
        return ()
    found = []
    ratio = misfit(first.held, ranking.noise)
    channel = int(np.argmax(ratio))
    if ratio[channel] > options.thresholds.split_misfit:
        text = f"{CHANNELS[channel]} is {ratio[channel]:.2g} times what the training flights leave"
        found.append(Finding("misfit", text, float(ratio[channel]), {}))
    residual = {e.name: ranking.best.residual(e) for e in first.flights}
    swung = {e.name: swing_free_residual(first.held, e) for e in first.held_out}
    usual = slow_power(first.flights, residual)
    probability, finding = novel_on_held_out(first.held_out, swung, options, usual)
    return (*found, finding) if probability > 0.5 else tuple(found)


def second_answer(first: Inference) -> tuple[Inference, list[FlightResiduals]] | None:
    """Return the inference with halves of the held-out flights, and these halves; None where all are too short.

    A wind is a condition of a flight: where the first answer names none, one can act in the halves alone.
    """
    joined, judges = split_flights(first.held_out, first.options.thresholds.split_half)
    if not joined:
        return None
    hanging = first.ranking.probability.get(PAYLOAD, 0.0) > first.options.thresholds.split_payload
    calm = not any(c.effect and c.effect.needs for c in first.causes)
    found = find_map_model([*first.flights, *joined], first.options, hanging=hanging, calm=calm)
    return concluded(found, judges), joined


def _middle(e: FlightResiduals) -> float:
    return 0.5 * (e.log.t[0] + e.log.t[-1])


def split_flights(
    flights: Sequence[FlightResiduals], least: float
) -> tuple[list[FlightResiduals], list[FlightResiduals]]:
    """Return the first halves of flights as flights of their own, and all flights with these rows marked as joined.

    least: duration of either half; shorter flights stay whole [s].
    """
    halves, judges = [], []
    for e in flights:
        log = e.log
        middle = _middle(e)
        if middle - log.t[0] < least:
            judges.append(e)
            continue
        half = dc.replace(log.rows(0, int(np.searchsorted(log.t, middle))), name=NAME.format(e.name))
        halves.append(dc.replace(make_flight_residuals(half, e.vehicle, e.grid.step), goes_on=True))
        judges.append(dc.replace(e, joined=e.t <= middle))
    return halves, judges


def without_onsets_in(flights: Sequence[FlightResiduals], cause: Cause) -> Cause:
    """Return the cause without its onsets in these flights, which are parts of others."""
    names = {e.name for e in flights}
    return dc.replace(cause, onset={n: t for n, t in cause.onset.items() if n not in names})
