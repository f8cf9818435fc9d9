"""What the causes leave: noise, or something the library does not have."""

from collections.abc import Sequence

from np_drake.diagnosis.adequacy.generic_structure import (
    generic_finding,
    material_shares,
    repeats_on_held_out,
)
from np_drake.diagnosis.adequacy.gust_evidence import gust_probability, swing_free_residual
from np_drake.diagnosis.adequacy.residual_statistics import slow_torque, strongest_line
from np_drake.diagnosis.adequacy.residual_tests import (
    Indication,
    beyond_bounds,
    irregularities,
    least_lines,
    line_test,
    novel_on_held_out,
    slow_torque_test,
)
from np_drake.diagnosis.adequacy.unexplained_result import Unexplained
from np_drake.diagnosis.fitting import Fit
from np_drake.diagnosis.held_out import on_held_out
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.selection import Ranking
from np_drake.diagnosis.wind import slow_power


def find_unexplained(
    ranking: Ranking, fit: Fit, flights: Sequence[FlightResiduals], held_out: Sequence[FlightResiduals]
) -> Unexplained:
    """Return the generic structure of the fit, and what the tests find in the residual of all flights."""
    options, named = ranking.options, ranking.named
    structured = bool(ranking.fits[0].generic) and flights[0].measured_rotors
    held = on_held_out(named, held_out, ranking.noise, options.priors, structured=structured)
    residual = {e.name: fit.residual(e) for e in flights}
    swung = {e.name: swing_free_residual(held, e) for e in held_out}
    hidden = any(t.swings for t in named.terms)
    slowly = gust_probability(named, options, flights, residual, held_out, swung)
    gusty = slowly > 0.5
    line, torque = (
        strongest_line(flights, residual, least_lines(flights, options.materiality)),
        slow_torque(flights, residual),
    )
    said: list[Indication] = []
    if not (hidden or gusty):
        rest = {e.name: named.residual(e) for e in flights} | swung
        said += irregularities([*flights, *held_out], rest, options)
    if not hidden:
        said.append(novel_on_held_out(held_out, swung, options, slow_power(flights, residual), gusty=gusty))
    said += beyond_bounds(named, flights[0].vehicle, options.thresholds, gusty=gusty)
    said.append(line_test(line, flights, held_out, swung, options))
    said.append(slow_torque_test(torque, flights, held_out, swung, options, hidden=hidden))
    generic = [generic_finding(g, ranking.noise, flights, options.materiality) for g in fit.generic]
    shares = material_shares(ranking, generic, repeats_on_held_out(ranking, fit, held_out, held))
    probability = max([*shares, *(p for p, _ in said)])
    findings = (*(f for f, _ in generic), *(f for p, f in said if p > 0.5))
    return Unexplained(probability > 0.5, probability, findings, held, slowly, structured)
