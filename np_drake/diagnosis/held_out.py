"""Models on flights to which they were not fitted.

Swings are taken from the first seconds and onsets from a scan; parameters are kept.
"""

import dataclasses as dc
from collections.abc import Collection, Sequence

import numpy as np

from np_drake.diagnosis.calibration import errors_of
from np_drake.diagnosis.fitting import Fit
from np_drake.diagnosis.forward_model import (
    MOST_JUMPS,
    NEVER,
    STATE,
    Term,
    has_swing,
    jumps,
    predicted_residual,
)
from np_drake.diagnosis.options import Options, Priors
from np_drake.diagnosis.regressors import onset_log_likelihood, times_of_changes
from np_drake.diagnosis.residuals import (
    LONGEST_BOUNCE,
    LONGEST_OUTLIER,
    MOST_OUTLIERS,
    OUTLIERS_APART,
    WRENCH,
    FlightResiduals,
    find_outliers,
)
from np_drake.diagnosis.result import Cause
from np_drake.diagnosis.swing_fit import SwingFit, fitted_to_whole_flight
from np_drake.estimation.noise import NoiseModel, with_loudness

# Over which a hidden start is fitted, at least, and a swing anew after an outlier; these rows are
# not scored [s].
HIDDEN_SPAN = 2.0
JUMP_SPAN = 1.5


def adapt(
    terms: Sequence[Term],
    flight: FlightResiduals,
    noise: NoiseModel,
    priors: Priors,
    calibration: Sequence[Term] = (),
    *,
    unmeasured: bool = False,
) -> list[Term]:
    """Return the terms with onset and initial swing adapted to a held-out flight, parameters kept,
    and the calibration.

    unmeasured: whether the vehicle is, so that what is not known to begin does not, unless it is
    sudden.
    """
    if calibration:
        flight = flight.revised(y=flight.y - predicted_residual(flight, calibration))
    known = [any(begin is not None for begin in t.onset.values()) for t in terms]
    # Of a wind, the drag through which it acts, if they began together in the fit.
    drag_of = {
        i: j
        for j, drag in reversed([*enumerate(terms)])
        for i, t in enumerate(terms)
        if drag.effect.identifier in type(t.effect).needs and drag.onset == t.onset
    }
    terms = [dc.replace(t, onset={}, hidden={}, changes={}) for t in terms]
    terms = [_anchored(terms, i, flight, noise, priors) for i in range(len(terms))]
    for i in sorted(range(len(terms)), key=lambda i: (not known[i], i in drag_of)):
        effect = terms[i].effect
        if i in drag_of:
            terms[i] = dc.replace(terms[i], onset=terms[drag_of[i]].onset)
        elif known[i] or (type(effect).begins and (effect.sudden or not unmeasured)):
            terms[i] = _with_onset(terms, i, flight, noise, priors, known=known[i])
    return [*terms, *calibration]


def mark_outliers(
    terms: Sequence[Term],
    flight: FlightResiduals,
    noise: NoiseModel,
    priors: Priors,
    calibration: Sequence[Term] = (),
) -> FlightResiduals:
    """Return the flight with its outliers marked, as the residual of the terms shows them.

    A swing is lost at an outlier, and what it misses from there on looks like more of them: they
    are taken in turn.
    """
    marked = flight
    flight = flight.revised(y=flight.y - predicted_residual(flight, calibration))
    for _ in range(MOST_JUMPS if has_swing(terms) else 0):
        # Where a swing is lost it misses ever more.
        outliers = _outliers(terms, flight, noise, priors, most=1.0)
        if flight.outliers.any():
            outliers &= flight.t > flight.t[np.flatnonzero(flight.outliers)[-1]] + OUTLIERS_APART
        if not outliers.any():
            return marked.revised(outliers=flight.outliers)
        start = int(np.argmax(outliers))
        first = np.zeros_like(outliers)
        first[start : start + int(np.argmin(np.append(outliers[start:], False)))] = True
        flight = flight.revised(outliers=flight.outliers | first)
    return marked.revised(outliers=flight.outliers | _outliers(terms, flight, noise, priors))


def _outliers(
    terms: Sequence[Term],
    flight: FlightResiduals,
    noise: NoiseModel,
    priors: Priors,
    most: float = MOST_OUTLIERS,
) -> np.ndarray:
    residual = flight.y - predicted_residual(flight, adapt(terms, flight, noise, priors))
    longest = LONGEST_BOUNCE if has_swing(terms) else LONGEST_OUTLIER
    return find_outliers(residual, flight.grid.step, longest, most)


def hidden_state_rows(term: Term, flight: FlightResiduals) -> list[np.ndarray]:
    """Return rows (m,) to which the hidden state is fitted: at its start, and after every
    outlier.
    """
    start = term.begins(flight.name)
    if not term.effect.has_hidden_state or start == NEVER:
        return []
    begin = flight.t[0] if start is None else start
    # A swing is told by a period: on a tether of a metre by `HIDDEN_SPAN`.
    length = term.effect.payload.length  # type: ignore[attr-defined]
    slow = max(1.0, 2 * np.pi * np.sqrt(length / flight.vehicle.gravity) / HIDDEN_SPAN)
    spans = [
        (begin, slow * HIDDEN_SPAN),
        *((float(flight.t[k]), slow * JUMP_SPAN) for k in jumps(flight, start)),
    ]
    return [(flight.t >= a) & (flight.t < a + span) for a, span in spans]


def scored_rows(terms: Sequence[Term], flight: FlightResiduals) -> np.ndarray:
    """Return (m,) the rows that count: seen by no fit and no hidden state, without a tether's
    outliers.

    In a flight so short that none would be left, all rows that no fit has seen
    (`scored_on_fitted_rows`).

    Args:
        terms: terms of a model, with their onsets and hidden states.
    """
    rows = ~flight.joined
    for fitted in (hidden_state_rows(term, flight) for term in terms):
        if fitted:
            rows = rows & ~np.any([*fitted, flight.outliers], axis=0)
    return rows if rows.any() else ~flight.joined


def scored_on_fitted_rows(terms: Sequence[Term], flight: FlightResiduals) -> bool:
    """Return whether a short flight is scored on rows to which its own swing was fitted.

    Args:
        terms: terms of a model, with their onsets and hidden states.
    """
    fitted = [rows for term in terms for rows in hidden_state_rows(term, flight)]
    return bool(np.any(scored_rows(terms, flight) & np.any(fitted, axis=0)))


def _anchored(
    terms: Sequence[Term], i: int, flight: FlightResiduals, noise: NoiseModel, priors: Priors
) -> Term:
    """Return the term, its swing fitted to the rows at its start, then every jump to those after
    the outlier.
    """
    now = list(terms)
    onset = terms[i].begins(flight.name)
    for k, rows in enumerate(hidden_state_rows(terms[i], flight)):
        fit = SwingFit(now, i, flight, noise, onset, rows, priors)
        swing = fit.descend_from_grid(fit.known, slice(k * STATE, (k + 1) * STATE))
        now[i] = fit.term(swing)
    return now[i]


def _with_onset(
    terms: list[Term],
    i: int,
    flight: FlightResiduals,
    noise: NoiseModel,
    priors: Priors,
    *,
    known: bool,
) -> Term:
    """Return the term from where it begins in this flight, its parameters being known (whatever a
    payload's swing was).

    known: to begin in flight. What acts from the start in all flights of the fit hardly begins late
    here, and is not excused where it is not there at all.
    """
    term = terms[i]
    if term.loads:  # jumps were fitted to the first load alone
        term = dc.replace(term, hidden={name: h[:STATE] for name, h in term.hidden.items()})
    terms = [*terms[:i], term, *terms[i + 1 :]]
    rest = predicted_residual(flight, [t for j, t in enumerate(terms) if j != i])
    trace = predicted_residual(flight, terms)
    if term.effect.has_hidden_state and (known or not term.loads):
        trace = _span_by_span(terms, i, flight, noise, priors, trace, rest)
    sizes = [1.0, *(load / term.effect.values["mass"] for load in term.loads)]
    t, profile, following = onset_log_likelihood(
        flight, noise, flight.y - rest, trace - rest, sizes, priors.onset_gain
    )
    k = int(np.argmax(profile))
    gain = priors.onset_gain if known else priors.new_onset_gain
    if profile[k] - profile[0] < gain or (t[k] == NEVER and not known):
        k = 0
    if k == 0 and not term.loads:
        return term
    terms[i] = dc.replace(
        term,
        onset={flight.name: float(t[k]) if k else None},
        hidden={},
        changes={flight.name: times_of_changes(t, following, k)},
    )
    return _anchored(terms, i, flight, noise, priors)


def _span_by_span(
    terms: Sequence[Term],
    i: int,
    flight: FlightResiduals,
    noise: NoiseModel,
    priors: Priors,
    followed: np.ndarray,
    rest: np.ndarray,
) -> np.ndarray:
    """Return (m, 15) the predicted residual with a payload that swings in every span as that span
    shows it by itself, whichever of its loads hangs there.

    A swing that is followed from the start of the flight is wrong wherever the payload was hung on
    later; where it explains a span better, it is right.

    Args:
        followed: (m, 15) the predicted residual with such a swing; rest: without the payload.
    """
    trace = followed.copy()
    mass = terms[i].effect.values["mass"]
    for start in np.arange(flight.t[0], flight.t[-1], HIDDEN_SPAN):
        rows = (flight.t >= start) & (flight.t < start + HIDDEN_SPAN)
        inside = rows[noise.phi.shape[1] :]
        if np.sum(inside) <= MOST_JUMPS * STATE:
            continue
        onset = None if start == flight.t[0] else float(start)
        now = list(terms)
        least = np.sum(flight.white(noise, flight.y - followed)[inside] ** 2)
        for load in filter(None, (mass, *terms[i].loads)):
            heavy = dc.replace(terms[i].effect, mass=load)  # type: ignore[type-var]
            now[i] = dc.replace(terms[i], effect=heavy, onset={flight.name: onset}, hidden={})
            fit = SwingFit(now, i, flight, noise, onset, rows, priors)
            now[i] = fit.term(fit.descend(fit.known))
            alone = predicted_residual(flight, now)
            loss = np.sum(flight.white(noise, flight.y - alone)[inside] ** 2)
            if loss < least:
                least = loss
                trace[rows] = (rest + (alone - rest) * mass / load)[rows]
    return trace


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

    def kept(self, name: str, identifiers: Collection[str]) -> list[Term]:
        """Return the terms of some effects in a flight, and the calibration."""
        return [
            term
            for i, term in enumerate(self.terms[name])
            if i >= self.effects or term.effect.identifier in {*identifiers, *self.calibrations}
        ]

    def remaining_residuals(self, identifiers: Collection[str]) -> dict[str, np.ndarray]:
        """Return by flight what some effects and the calibration leave (m, 15)."""
        return {
            flight.name: flight.y - predicted_residual(flight, self.kept(flight.name, identifiers))
            for flight in self.flights
        }

    def swing_free_residual(self, flight: FlightResiduals) -> np.ndarray:
        """Return the residual (m, 15) of a flight with a payload's swing fitted to all of it,
        outliers interpolated.
        """
        return flight.bridged(
            flight.y - predicted_residual(flight, self.whole_flight_terms[flight.name])
        )


def on_held_out(
    fit: Fit, flights: Sequence[FlightResiduals], noise: NoiseModel, options: Options
) -> HeldOut:
    """Return the fit on held-out flights, its onsets and swings adapted to each, its parameters
    kept.

    The least squared miss of the rest of a flight is expected of the mean over samples of each
    swing from its posterior: a swing that is not known, or that no motion tells for long after its
    tether went slack, fades to the weight that hangs.
    Source: mean of a posterior; own choice: by Laplace's approximation, parameters kept.
    """
    terms = {}
    residual = {}
    rows = {}
    full_flight = {}
    priors = options.priors
    unmeasured = options.tolerance.unmeasured
    for flight in flights:
        known = adapt(fit.terms, flight, noise, priors, fit.calibration, unmeasured=unmeasured)
        terms[flight.name] = list(known)
        for i, term in enumerate(known):
            begin = term.begins(flight.name)
            spans = [
                SwingFit(known, i, flight, noise, begin, fitted_rows, priors)
                for fitted_rows in hidden_state_rows(term, flight)
            ]
            if spans:
                swings = spans[0].known + sum(
                    span.posterior_swings(slice(k * STATE, (k + 1) * STATE))
                    for k, span in enumerate(spans)
                )
                terms[flight.name][i] = dc.replace(term, hidden={flight.name: swings})
        residual[flight.name] = flight.y - predicted_residual(flight, terms[flight.name])
        rows[flight.name] = scored_rows(terms[flight.name], flight)
        full_flight[flight.name] = fitted_to_whole_flight(known, flight, noise, priors)
    return HeldOut(flights, terms, residual, rows, full_flight, len(fit.terms))


def subtract_fitted_calibration(
    fit: Fit, flight: FlightResiduals, noise: NoiseModel, options: Options
) -> FlightResiduals:
    """Return a held-out flight without what the calibration of the vehicle gives, and what it
    differs by itself.

    An earlier calibration of the flight is undone.
    """
    if not options.tolerance.real:
        return flight
    errors = errors_of(flight, options.tolerance)
    flight = flight.revised(y=flight.uncalibrated, calibrated=0.0)
    shared = sum(
        (columns(flight) @ c for columns, c in fit.calibrated), start=np.zeros_like(flight.y)
    )
    there = flight.revised(y=flight.y - shared)
    terms = adapt(
        fit.terms,
        there,
        noise,
        options.priors,
        fit.calibration,
        unmeasured=options.tolerance.unmeasured,
    )
    residual = there.y - predicted_residual(there, terms)
    # Sensors that are worse in this flight do not decide about it.
    louder = with_loudness(noise, [flight.bridged(residual)], [flight.name], quietest=1.0)
    mean, _ = there.gram(louder, [errors], residual).posterior(np.arange(errors.shape[-1]))
    given = shared + errors @ mean
    return flight.revised(y=flight.known(flight.y - given), calibrated=flight.known(given))


def pooled(parts: Sequence[np.ndarray], noise: NoiseModel) -> float:
    """Return the RMS over rows and wrench channels, channels divided by their noise [1].

    Args:
        parts: residuals (m, 15), which count together.
    """
    rows = np.concatenate(parts)[:, WRENCH] / np.maximum(noise.rms[WRENCH], 1e-12)
    return float(np.sqrt(np.mean(rows**2)))


def remaining_residual(causes: Sequence[Cause], noise: NoiseModel, held_out: HeldOut) -> float:
    """Return the RMS residual of some causes on held-out flights, in units of the noise [1]."""
    residual = held_out.remaining_residuals({c.identifier for c in causes})
    return pooled([residual[name][rows] for name, rows in held_out.rows.items()], noise)
