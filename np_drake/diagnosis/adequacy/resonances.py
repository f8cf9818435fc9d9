"""Frequency and damping of the resonances that remain."""

import dataclasses as dc

from np_drake.diagnosis.adequacy.unexplained_result import Unexplained
from np_drake.diagnosis.fitting import mode_of
from np_drake.diagnosis.result import Finding
from np_drake.diagnosis.selection import Ranking


def with_fitted_resonances(unexplained: Unexplained, ranking: Ranking) -> Unexplained:
    """Return the unexplained structure with frequency [Hz] and damping [1] of its resonances fitted."""
    fit, flights = ranking.fits[0], ranking.problem.flights
    rest = {e.name: fit.residual(e) for e in flights}
    swinging = [g for g in fit.generic if g.candidate.swing is not None]
    modes = {g.candidate.variant: mode_of(g, flights, rest, ranking.noise) for g in swinging}
    return dc.replace(
        unexplained, findings=tuple(_with_mode(f, modes.get(f.text)) for f in unexplained.findings)
    )


def _with_mode(finding: Finding, mode: tuple[float, float] | None) -> Finding:
    if mode is None:
        return finding
    frequency, damping = mode
    figures = finding.figures | {"frequency": frequency, "damping": damping}
    text = f"{finding.text}; fitted: {frequency:.3g} Hz, damping {damping:.2g}"
    return dc.replace(finding, text=text, figures=figures)
