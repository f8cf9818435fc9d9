"""What the causes leave: noise, or something the library does not have."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from scipy import special

from np_drake.diagnosis.adequacy.gust_evidence import gust_probability, swing_free_residual
from np_drake.diagnosis.adequacy.linear_model import LinearModel
from np_drake.diagnosis.adequacy.residual_statistics import slow_torque, strongest_line
from np_drake.diagnosis.adequacy.residual_tests import (
    Indication,
    burst_test,
    least_lines,
    least_structure,
    line_test,
    slow_torque_test,
)
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.regressors import PREFIX
from np_drake.diagnosis.residuals import FORCE, TORQUE, FlightResiduals
from np_drake.diagnosis.result import Finding
from np_drake.diagnosis.selection import Ranking


@dc.dataclass(frozen=True)
class Unexplained:
    """What the effects of the best model leave.

    probability: that something material is left, a slow level force apart [1].   findings: where it lives.
    slow_probability: of a slow level force [1].
    """

    probability: float
    findings: tuple[Finding, ...]
    slow_probability: float


def find_unexplained(
    ranking: Ranking,
    linear: LinearModel,
    structure: Sequence[int],
    held_out: Sequence[FlightResiduals],
    held: HeldOut,
) -> Unexplained:
    """Return the generic structure beside the best model, and what the tests find in the residual of all flights."""
    options, best, flights = ranking.options, ranking.best, ranking.problem.flights
    residual = {e.name: best.residual(e) for e in flights}
    swung = {e.name: swing_free_residual(held, e) for e in held_out}
    hidden = any(t.swings for t in best.terms)
    slowly = gust_probability(best, options, flights, residual, held_out, swung)
    said: list[Indication] = [indication(linear, structure, g, options.materiality) for g in structure]
    if not (hidden or slowly > 0.5):
        said.append(burst_test([*flights, *held_out], residual | swung, options))
    line = strongest_line(flights, residual, least_lines(flights, options.materiality))
    said.append(line_test(line, flights, held_out, swung, options))
    torque = slow_torque(flights, residual)
    said.append(slow_torque_test(torque, flights, held_out, swung, options, hidden=hidden))
    probability = max((p for p, _ in said), default=0.0)
    return Unexplained(probability, tuple(f for p, f in said if p > 0.5), slowly)


def indication(linear: LinearModel, structure: Sequence[int], g: int, materiality) -> Indication:
    """Return structure g beside the best model as a finding, with the probability that it is there and material."""
    flights, candidate = linear.flights, linear.structure[g]
    rest = tuple(k for k in structure if k != g)
    there = float(special.expit(linear.evidence((), structure) - linear.evidence((), rest)))
    part = np.concatenate([linear.part(structure, g, e) for e in flights])
    force, torque = (float(np.sqrt(np.mean(np.sum(part[:, c] ** 2, axis=1)))) for c in (FORCE, TORQUE))
    least_force, least_torque = least_structure(flights, materiality)
    figures = {"force": force, "torque": torque, **candidate.figures}
    name = candidate.identifiers[0].removeprefix(PREFIX)
    weight = flights[0].vehicle.mass * flights[0].vehicle.gravity
    finding = Finding(name, candidate.variant, force / weight, figures)
    return there if force >= least_force or torque >= least_torque else 0.0, finding
