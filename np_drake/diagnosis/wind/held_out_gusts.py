"""Held-out flights under gusts."""

import dataclasses as dc
from collections.abc import Sequence

from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.regressors import DRAG, GUSTY
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause


def in_gusts(held: HeldOut, causes: Sequence[Cause], flights: Sequence[FlightResiduals]) -> HeldOut:
    """Return the held-out flights with the mean of the gusts in the place of a steady wind.

    causes: the gusts and the drag that feels them among them, each from when on it acts.
    """
    by_name = {c.identifier: c for c in causes}
    gusts, drag = by_name["gusty_wind"], by_name[DRAG]
    assert gusts.effect is not None
    assert drag.effect is not None
    terms, residual = dict(held.terms), dict(held.residual)
    for e in flights:
        rest = [t for t in held.terms[e.name] if t.effect.identifier not in GUSTY]
        felt = Term(drag.effect, {e.name: drag.onset.get(e.name)})
        terms[e.name] = [*rest, felt, Term(gusts.effect.foreseen, {e.name: gusts.onset.get(e.name)})]
        residual[e.name] = e.y - predicted_residual(e, terms[e.name])
    return dc.replace(held, terms=terms, residual=residual)
