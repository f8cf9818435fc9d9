"""Refinement of change points to a row of the logs.

A strong effect that begins a row late or early leaves a step of one row, which a lag or a clock would explain.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.regressors import Candidate, Model, RegressionProblem, switched
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.selection.payload_search import PAYLOAD


def refined_change_points(problem: RegressionProblem, model: Model) -> list[Candidate]:
    """Return the model's effects with refined onsets, sought alone and beside the rest.

    Not a payload, whose swing begins anew with its onset: `PayloadSearch.when` is as sharp.   Source: log evidence at
    every row [s] within a step of the grid; own choice: flight by flight, once, and only those that differ are given.
    """
    found: list[Candidate] = []
    members = [problem.candidates[i] for i in model.members]
    for late in (c for c in members if c.onset and PAYLOAD not in c.identifiers):
        others = [c for c in members if c is not late]
        for beside in [[], others] if others else [[]]:
            sharp = _sharp(problem, late, beside)
            if sharp.onset not in [
                late.onset,
                *(c.onset for c in found if c.identifiers == late.identifiers),
            ]:
                found.append(sharp)
    return found


def _sharp(problem: RegressionProblem, late: Candidate, beside: Sequence[Candidate]) -> Candidate:
    """Flight by flight, the onsets in the others as they are; as it is where the effect is not tried from the start."""
    whole = next((c for c in problem.candidates if _from_the_start(c, late)), None)
    if whole is None:
        return late
    for e in problem.flights:
        begin = late.onset.get(e.name)
        if begin is None or not np.isfinite(begin):
            continue
        onsets = [{**late.onset, e.name: float(t)} for t in _rows_about(e, begin)]
        tried = [
            dc.replace(switched(whole, problem.flights, o), onset_prior=late.onset_prior) for o in onsets
        ]
        small = RegressionProblem(
            problem.flights,
            problem.noise,
            problem.nuisance,
            [*beside, late, *tried],
            temperature=problem.temperature,
            options=problem.options,
            wide=problem.wide,
        )
        rest = range(len(beside))
        scores = small.scores([(*rest, k) for k in range(len(beside), len(small.candidates))])
        late = [late, *tried][int(np.argmax(scores))]
    return late


def _from_the_start(candidate: Candidate, late: Candidate) -> bool:
    same = (candidate.identifiers, candidate.variant) == (late.identifiers, late.variant)
    return same and not candidate.onset


def _rows_about(e: FlightResiduals, begin: float) -> np.ndarray:
    """Instants of the log within a step of the grid."""
    return e.log.t[np.abs(e.log.t - begin) < 1.01 * e.grid.step]
