"""Held-out flights may show what training flights do not excite: a drag, where those hover.

Then the first half of each joins the fit, and its second half alone judges.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence

import numpy as np

from np_drake.diagnosis.adequacy.residual_tests import novel
from np_drake.diagnosis.adequacy.unexplained import blown, without_swing
from np_drake.diagnosis.decision.decide import Compared, Look, compare, conclude
from np_drake.diagnosis.held_out.adaptation import without_shocks
from np_drake.diagnosis.held_out.prediction import HeldOut, misfit, on_held_out
from np_drake.diagnosis.numerics.autoregressive_noise import NoiseModel
from np_drake.diagnosis.residuals.flight_residuals import Evidence, make_evidence
from np_drake.diagnosis.selection.map_model import Found, find
from np_drake.diagnosis.selection.payload_search import PAYLOAD
from np_drake.diagnosis.selection.ranking import probabilities
from np_drake.diagnosis.tolerance import Tolerance
from np_drake.diagnosis.wind.slow_force import slow_power

UNLIKELY = 0.01  # probability of a payload below which it is not sought again; own choice
UNFORESEEN = {True: 1.6, False: 1.25}  # residual over noise, on a rig and in a laboratory [1]; own choice
LEAST = 4.0  # that either half must last [s]; own choice
NAME = "first half of {}"


def look_twice(
    flights: Sequence[Evidence],
    unseen: Sequence[Evidence],
    tolerance: Tolerance | None,
    on_progress: Callable[[float, str], None],
) -> tuple[Look, list[Evidence]]:
    """A look, or a second one where there is cause for it; with the halves of unseen flights that joined its fit.

    Where the best model plainly shows that there is, it is not compared with its rivals before.
    """
    first = _first_look(flights, unseen, tolerance)
    if isinstance(first, Look):
        return first, []
    on_progress(0.4, "what held-out flights show")
    joined, judges = halved(unseen)
    hanging = first > UNLIKELY
    return conclude(compare(find([*flights, *joined], tolerance, hanging=hanging), judges)), joined


def _first_look(
    flights: Sequence[Evidence], unseen: Sequence[Evidence], tolerance: Tolerance | None
) -> Look | float:
    """The look, if it is enough, else the probability of a payload in it: the rest would take memory of the second."""
    found = find(flights, tolerance)
    if not any(_middle(e) - e.log.t[0] >= LEAST for e in unseen):
        return conclude(compare(found, unseen))
    if plainly_unforeseen(found, unseen):
        return probabilities(found.problem, found.models, [found.best]).get(PAYLOAD, 0.0)
    first = compare(found, unseen)
    return first.ranking.probability.get(PAYLOAD, 0.0) if unforeseen(first) else conclude(first)


def unforeseen(first: Compared) -> bool:
    """Is more left on some channel of the held-out flights than noise, or a force or torque that these do not excite?

    Gusts, which repeat nowhere, and a payload, whose swing may be lost, do not count.
    """
    if first.gusty or any(t.swings for t in first.ranking.named.terms):
        return False
    return first.left.novel or _more_than_noise(first.left.held, first.ranking.noise, first.ranking.tolerance)


def plainly_unforeseen(found: Found, unseen: Sequence[Evidence]) -> bool:
    """The same by the best model before it is compared: where structure that no effect explains is in it, and no swing.

    Then unseen flights are not asked which of its rivals they would have (`close_call`), and a slow force is part of
    that structure, no gusts.
    """
    best, noise, tolerance, flights = found.best, found.noise, found.tolerance, found.problem.flights
    if not best.generic or any(t.swings for t in best.terms):
        return False
    unseen = [without_shocks(best.everything, e, noise) for e in unseen]
    held = on_held_out(best, unseen, noise, structured=flights[0].measured_rotors)
    if _more_than_noise(held, noise, tolerance):
        return True
    left = {e.name: best.left(e) for e in flights}
    swung = {e.name: without_swing(held, e) for e in unseen}
    gusty = blown(best, tolerance, flights, left, unseen, swung) > 0.5
    return novel(unseen, swung, tolerance, slow_power(flights, left), gusty=gusty)[0] > 0.5


def _more_than_noise(held: HeldOut, noise: NoiseModel, tolerance: Tolerance) -> bool:
    return bool(misfit(held, noise).max() > UNFORESEEN[tolerance.real])


def _middle(e: Evidence) -> float:
    return 0.5 * (e.log.t[0] + e.log.t[-1])


def halved(flights: Sequence[Evidence]) -> tuple[list[Evidence], list[Evidence]]:
    """First halves of long enough flights, as flights of their own; and all flights, these rows not counting."""
    halves, judges = [], []
    for e in flights:
        log = e.log
        middle = _middle(e)
        if middle - log.t[0] < LEAST:
            judges.append(e)
            continue
        half = dc.replace(log.rows(0, int(np.searchsorted(log.t, middle))), name=NAME.format(e.name))
        halves.append(dc.replace(make_evidence(half, e.vehicle, e.grid.step), goes_on=True))
        judges.append(dc.replace(e, joined=e.t <= middle))
    return halves, judges
