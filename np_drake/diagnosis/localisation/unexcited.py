"""Diagnosis of flights without excitation: the residual is localised, and no cause is named."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from np_drake.diagnosis.held_out import pooled
from np_drake.diagnosis.localisation.identifiability import confusables, excitation
from np_drake.diagnosis.localisation.localisation import localise
from np_drake.diagnosis.numerics import fit_noise
from np_drake.diagnosis.regressors import library_candidates
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import GapReduction, Identifiability


def unexcited_diagnosis(
    flights: Sequence[FlightResiduals], held_out: Sequence[FlightResiduals]
) -> dict[str, Any]:
    """Return the fields of a `Diagnosis` for flights in which nothing moves: an empty verdict, nothing identifiable."""
    noise = fit_noise([e.y - e.y.mean(axis=0) for e in flights], flights[0].grid.step)
    pairs = confusables(flights, library_candidates(flights), noise)
    rows = {e.name: np.ones(len(e.t), bool) for e in held_out}
    checked = Identifiability(
        False, excitation(flights), {}, tuple(pairs), ("nothing is excited: these logs cannot tell.",)
    )
    size = pooled([e.y for e in held_out], noise)
    return {
        "verdict": (),
        "causes": (),
        "identifiability": checked,
        "localisation": localise(held_out, {e.name: e.y for e in held_out}, noise, rows),
        "gap_reduction": GapReduction(size, size, 1.0, 0.0, (0.0, 0.0), ()),
        "warnings": checked.warnings,
    }
