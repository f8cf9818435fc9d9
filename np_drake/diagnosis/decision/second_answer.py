"""Second answer: first halves of held-out flights join the fit where they show what training
flights do not.

The second halves alone judge it.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.calibration.columns import with_fixed_effects
from np_drake.diagnosis.calibration.torque_gain import with_torque_gain
from np_drake.diagnosis.decision.infer import Inference, conclude
from np_drake.diagnosis.held_out import misfit
from np_drake.diagnosis.residuals import FlightResiduals, make_flight_residuals
from np_drake.diagnosis.residuals.residual_parts import CHANNELS
from np_drake.diagnosis.result import Cause, Finding
from np_drake.diagnosis.selection import find_map_model
from np_drake.effects.gusty_wind import GustyWind
from np_drake.files.number_text import number

NAME = "first half of {}"
LEAST_HALF = 4.0  # duration of either half of a flight, below which it stays whole [s]; own choice


def novelty(first: Inference) -> tuple[Finding, ...]:
    """Return whether held-out flights show what training flights do not, as a sentence or none.

    Gusts, which repeat nowhere, and a payload, whose swing may be lost, do not count.
    """
    ranking = first.ranking
    if any(c.identifier == GustyWind.identifier for c in first.causes) or any(
        t.has_hidden_state for t in ranking.best.terms
    ):
        return ()
    ratio = misfit(first.held, ranking.noise)
    channel = int(np.argmax(ratio))
    if ratio[channel] <= first.options.thresholds.misfit_ratio:
        return ()
    text = (
        f"{CHANNELS[channel]} is {number(float(ratio[channel]), 2)} times what the training "
        f"flights leave"
    )
    return (
        Finding(
            "misfit",
            text,
            float(ratio[channel]),
            {},
            "fly the held-out trajectory again, and fit it",
        ),
    )


def second_answer(first: Inference) -> tuple[Inference, list[FlightResiduals]] | None:
    """Return the inference with halves of the held-out flights, and these halves; None where all
    are too short.

    A wind is a condition of a flight: where the first answer names none, one can act in the halves
    alone.
    """
    joined, judges = split_flights(first.held_out)
    if not joined:
        return None
    still_air = not any(c.effect and c.effect.needs for c in first.causes)
    return conclude(
        find_map_model([*first.flights, *joined], first.options, still_air=still_air), judges
    ), joined


def split_flights(
    flights: Sequence[FlightResiduals],
) -> tuple[list[FlightResiduals], list[FlightResiduals]]:
    """Return the first halves of flights as flights of their own, and all flights with these rows
    marked as joined.
    """
    halves, judges = [], []
    for e in flights:
        log = e.log
        middle = 0.5 * (log.t[0] + log.t[-1])
        if middle - log.t[0] < LEAST_HALF:
            judges.append(e)
            continue
        half = dc.replace(
            log.rows(0, int(np.searchsorted(log.t, middle))), name=NAME.format(e.name)
        )
        (own,) = with_torque_gain(
            [with_fixed_effects(make_flight_residuals(half, e.vehicle, e.grid.step))],
            np.array(e.torque_gain),
        )
        halves.append(dc.replace(own, goes_on=True))
        judges.append(dc.replace(e, joined=e.t <= middle))
    return halves, judges


def without_onsets_in(flights: Sequence[FlightResiduals], cause: Cause) -> Cause:
    """Return the cause without its onsets in these flights, which are parts of others."""
    names = {e.name for e in flights}
    return dc.replace(cause, onset={n: t for n, t in cause.onset.items() if n not in names})
