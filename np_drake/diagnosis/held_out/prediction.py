"""Predicted residual of a fit on held-out flights."""

import dataclasses as dc
from collections.abc import Collection, Sequence

import numpy as np

from np_drake.diagnosis.calibration.columns import errors_of
from np_drake.diagnosis.fitting import Fit, fitted_to_whole_flight
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.held_out.adaptation import adapt, predictive_terms, scored_rows
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Options, Priors
from np_drake.diagnosis.residuals import WRENCH, FlightResiduals
from np_drake.diagnosis.result import Cause

LEAST_GAP = 0.02  # gap over noise power below which there is none to close [1]; own choice


@dc.dataclass(frozen=True)
class HeldOut:
    """Held-out flights under a fit: adapted terms, residual (m, 15), and rows that count, by
    flight.

    whole_flight_terms: the terms with hidden states that fit the whole flight.
    """

    flights: Sequence[FlightResiduals]
    terms: dict[str, list[Term]]
    residual: dict[str, np.ndarray]
    rows: dict[str, np.ndarray]
    whole_flight_terms: dict[str, list[Term]]
    effects: int = 0  # number of terms that are effects; those after them are calibration
    calibrations: frozenset[str] = frozenset()  # effects that count as calibration

    @property
    def calibrated(self) -> bool:
        """Whether a calibration of the vehicle acts beside the effects."""
        return any(isinstance(e.calibrated, np.ndarray) for e in self.flights)

    def kept(self, name: str, identifiers: Collection[str]) -> list[Term]:
        """Return the terms of some effects in a flight, and the calibration."""
        every = self.terms[name]
        kept = {*identifiers, *self.calibrations}
        return [
            *(t for t in every[: self.effects] if t.effect.identifier in kept),
            *every[self.effects :],
        ]

    def swing_free_residual(self, e: FlightResiduals) -> np.ndarray:
        """Return the residual (m, 15) of a flight with a payload's swing fitted to all of it,
        outliers interpolated.
        """
        return e.bridged(e.y - predicted_residual(e, self.whole_flight_terms[e.name]))


def on_held_out(
    fit: Fit, flights: Sequence[FlightResiduals], noise: NoiseModel, priors: Priors
) -> HeldOut:
    """Return the fit on held-out flights, its onsets and swings adapted to each, its parameters
    kept.
    """
    terms, residual, rows, whole = {}, {}, {}, {}
    for e in flights:
        known = adapt(fit.terms, e, noise, priors, fit.calibration, unmeasured=bool(fit.calibrated))
        terms[e.name] = predictive_terms(known, e, noise, priors)
        residual[e.name] = e.y - predicted_residual(e, terms[e.name])
        rows[e.name] = scored_rows(terms[e.name], e)
        whole[e.name] = fitted_to_whole_flight(known, e, noise, priors)
    return HeldOut(flights, terms, residual, rows, whole, len(fit.terms))


def with_calibration(
    fit: Fit, e: FlightResiduals, noise: NoiseModel, options: Options
) -> FlightResiduals:
    """Return a held-out flight without what the calibration of the vehicle gives, and what it
    differs by itself.

    An earlier calibration of the flight is undone.
    """
    unmeasured = options.tolerance.unmeasured
    if not options.tolerance.real:
        return e
    own = errors_of(e, options.tolerance)
    e = dc.replace(e, y=e.uncalibrated, calibrated=0.0)
    shared = fit.calibration_on(e)
    there = dc.replace(e, y=e.y - shared)
    terms = adapt(fit.terms, there, noise, options.priors, fit.calibration, unmeasured=unmeasured)
    left = there.y - predicted_residual(there, terms)
    gram = dc.replace(there, y=left).gram(noise, [own])
    mean, _ = gram.posterior(np.arange(own.shape[-1]))
    given = shared + own @ mean
    return dc.replace(e, y=e.known(e.y - given), calibrated=e.known(given))


def misfit(held: HeldOut, noise: NoiseModel) -> np.ndarray:
    """Return (6,) the RMS residual of held-out flights over noise, by channel of the wrench [1]."""
    residual = np.concatenate(
        [held.residual[name][rows, WRENCH] for name, rows in held.rows.items()]
    )
    return np.sqrt(np.mean(residual**2, axis=0)) / np.maximum(noise.rms[WRENCH], 1e-12)


def pooled(parts: Sequence[np.ndarray], noise: NoiseModel) -> float:
    """Return the RMS over rows and wrench channels, channels divided by their noise [1].

    Args:
        parts: residuals (m, 15), which count together.
    """
    rows = np.concatenate(parts)[:, WRENCH] / np.maximum(noise.rms[WRENCH], 1e-12)
    return float(np.sqrt(np.mean(rows**2)))


def closed_fraction(before: float, after: float, floor: float) -> float:
    """Return 1 - (after² - floor²) / (before² - floor²), limited to -1 … 1; zero where there was no
    gap [1].
    """
    gap = before**2 - floor**2
    if gap <= LEAST_GAP * floor**2:
        return 0.0
    return float(np.clip(1 - (after**2 - floor**2) / gap, -1.0, 1.0))


def remaining_residual(causes: Sequence[Cause], noise: NoiseModel, held: HeldOut) -> float:
    """Return the RMS residual of some causes on held-out flights, in units of the noise [1]."""
    names = {c.identifier for c in causes}
    parts = []
    for e in held.flights:
        terms = held.kept(e.name, names)
        parts.append((e.y - predicted_residual(e, terms))[held.rows[e.name]])
    return pooled(parts, noise)
