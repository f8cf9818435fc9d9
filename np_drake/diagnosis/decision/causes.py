"""From a ranking of models to causes: material ones, minor ones, what cannot be told from them, and the unknown."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.decision.consistency import without_faint_shifts, without_missing_drag
from np_drake.diagnosis.fitting.map_estimate import Fit
from np_drake.diagnosis.fitting.physical_bounds import impossible, interval
from np_drake.diagnosis.forward_model.payload_state import pendulum_error
from np_drake.diagnosis.forward_model.prediction import predicted_residual
from np_drake.diagnosis.forward_model.term import NEVER, Term
from np_drake.diagnosis.held_out.adaptation import SURPRISE
from np_drake.diagnosis.held_out.prediction import HeldOut
from np_drake.diagnosis.materiality import LEAST_FORCED, LEAST_SHARE, Size
from np_drake.diagnosis.numerics.autoregressive_noise import NoiseModel
from np_drake.diagnosis.regressors.library import DRAG, GUSTY
from np_drake.diagnosis.regressors.nuisance import Drift, drift_of, loss_on
from np_drake.diagnosis.regressors.regression_problem import Model, RegressionProblem
from np_drake.diagnosis.residuals import flight_residuals as ev
from np_drake.diagnosis.residuals.flight_residuals import FlightResiduals
from np_drake.diagnosis.result import Cause, Estimate, Finding
from np_drake.diagnosis.selection.calibration import calibrated_probability
from np_drake.diagnosis.selection.ranking import Ranking, names_of, names_of_fit
from np_drake.diagnosis.tolerance import Tolerance
from np_drake.effects.base import ActuatorEffect, SensorEffect

SURE = {True: 0.5, False: 0.75}  # least probability of a name, on a rig and in a laboratory; own choice
SEEN_AGAIN = 20.0  # log evidence that it brings to unseen flights, where a rig's will do; own choice
CALIBRATION = ("mass_error", "thrust_scale")  # within tolerance they are no cause
HURT = 2.0  # log evidence on flights that it has not seen, which says nothing of an effect; own choice
MISFIT = 0.01  # and of what it brings to those of its fit [1]; own choice
SAME = 3.5  # difference of log evidence below which two explanations are the same in these data
MOST_LIKE = 2  # names beside a cause's own
PROBABILITY = "probability"  # figure of a finding that would be a cause if it were surer


def size_of(
    fit: Fit,
    i: int,
    flights: Sequence[FlightResiduals],
    noise: NoiseModel,
    tolerance: Tolerance,
    unseen: Sequence[tuple[FlightResiduals, Sequence[Term]]] = (),
) -> Size:
    """Of the fit's term i, over its flights and unseen ones (with their terms as `adapt` has them); its gap: its own.

    What does little where it was fitted may do much elsewhere, as a drag in a flight that is faster. A half of a flight
    that joined the fit counts in both.   Source: own choice.
    """
    force = torque = command = rows = own = gap = 0.0
    inverse = np.where(noise.rms > 0, 1.0 / np.maximum(noise.rms, 1e-12), 0.0)
    fitted = [(e, fit.everything) for e in flights]
    for k, (e, terms) in enumerate([*fitted, *unseen]):
        part = predicted_residual(e, terms) - predicted_residual(
            e, [t for j, t in enumerate(terms) if j != i]
        )
        force += np.sum(part[:, ev.FORCE] ** 2)
        torque += np.sum(part[:, ev.TORQUE] ** 2)
        command += np.sum((e.nominal[:, 3:] - e.nominal[:, 3:].mean(axis=0)) ** 2)
        rows += len(part)
        if k < len(fitted):
            own += np.sum((part * inverse) ** 2)
            gap += np.sum((e.y * inverse) ** 2) - e.y.shape[0] * np.sum(noise.rms > 0)
    weight = flights[0].vehicle.mass * flights[0].vehicle.gravity
    effect = fit.terms[i].effect
    return Size(
        float(np.sqrt(force / rows)) / weight,
        float(np.sqrt(torque / max(command, 1e-12))),
        float(own / max(gap, own, 1e-9)),
        float(np.linalg.norm(list(effect.values.values()))) / max(tolerance.of(effect.identifier), 1e-9),
    )


def indistinguishable(problem: RegressionProblem, model: Model) -> dict[str, tuple[str, ...]]:
    """By effect of the best model: effects which in its place explain the logs as well."""
    out: dict[str, tuple[str, ...]] = {}
    for i in model.members:
        if problem.candidates[i].generic:
            continue
        own = problem.candidates[i].identifiers
        rest = tuple(j for j in model.members if j != i)
        found: dict[str, float] = {}
        for k, other in enumerate(problem.candidates):
            members = (*rest, k)
            if other.generic or set(other.identifiers) & set(own) or not problem.fits_together(members):
                continue
            loss = model.score - problem.score(members)
            if loss < SAME:
                name = other.identifiers[-1]
                found[name] = min(loss, found.get(name, np.inf))
        names = sorted(found, key=lambda n: found[n])[:MOST_LIKE]
        for name in own:
            out[name] = tuple(names)
    return out


def within_calibration(term: Term, tolerance: Tolerance) -> bool:
    """Is it what the file of a rig may be off by? Not if it begins in flight: files do not change there."""
    late = any(begin is not None for begin in term.onset.values())
    return term.effect.identifier in CALIBRATION and tolerance.real and not late


def causes_of(
    ranking: Ranking,
    fit: Fit,
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    held: HeldOut,
    *,
    gusty: bool = False,
) -> tuple[list[Cause], list[Finding]]:
    """Causes and minor findings of a fit: a cause is material, and helps on flights that the fit has not seen.

    gusty: gusts were felt. Then the drag that feels them matters however small it is by itself, may lie at its bound,
    and neither it nor the wind must help on unseen flights, where it blew otherwise.
    """
    members = {names_of(ranking.named_problem, m): m for m in reversed(ranking.named_models)}
    key = names_of_fit(ranking.named)
    same = indistinguishable(ranking.named_problem, members[key]) if key in members else {}
    drift = drift_of([*flights, *held_out], ranking.noise, ranking.tolerance)
    causes, minor = [], []
    unseen = [(e, held.terms[e.name]) for e in held_out]
    for i, term in enumerate(fit.terms):
        size = size_of(fit, i, flights, ranking.noise, ranking.tolerance, unseen)
        cause = _cause(ranking, fit, i, term, [*flights, *held_out], same, size, held)
        calibration = within_calibration(term, ranking.tolerance)
        sensor, real = ranking.tolerance.of(term.effect.identifier) > 0, ranking.tolerance.real
        brought = log_bayes_factor(fit, i, held_out, ranking.noise, held, drift)
        confirmed = brought > least_log_bayes_factor(fit, i, flights, ranking.noise, drift)
        confirmed |= gusty and term.effect.identifier in GUSTY
        material = size.material(
            calibration=calibration, sensor=sensor, real=real, least=_least_share(fit, i, brought)
        )
        feels_gusts = gusty and term.effect.identifier == DRAG
        material |= feels_gusts
        sure = cause.probability >= SURE[real or brought > SEEN_AGAIN] or feels_gusts
        told = fit.is_significant(i) or feels_gusts
        stands_for = impossible(fit, i, flights[0].vehicle, gusty=gusty)
        if confirmed and material and sure and told and not stands_for:
            causes.append(cause)
        else:
            minor.append(_minor(cause, size, confirmed, material, told, stands_for))
    return without_faint_shifts(*without_missing_drag(causes, minor))


def _least_share(fit: Fit, i: int, brought: float) -> float:
    """Of the gap, for term i to matter [1].   brought: log evidence that it brings to unseen flights.

    Unlike a payload's swing, so fainter beside it, are sensors, clocks, and dead times that unseen flights bear out.
    """
    effect = fit.terms[i].effect
    timed = isinstance(effect, ActuatorEffect) and effect.dead_time > 0.0
    beside = any(t.swings for j, t in enumerate(fit.terms) if j != i)
    unlike = isinstance(effect, SensorEffect) or (timed and brought > HURT)
    return LEAST_FORCED if beside and not unlike else LEAST_SHARE


def _minor(cause: Cause, size: Size, confirmed: bool, material: bool, told: bool, stands_for: str) -> Finding:
    values = ", ".join(f"{n} {e.value:.3g} {e.unit}" for n, e in cause.parameters.items())
    why = "immaterial" if confirmed else "not confirmed by the held-out flights"
    figures = {"force": size.force, "torque": size.torque}
    if confirmed and material:
        why = f"not sure, {cause.probability:.2g}"
        figures |= {PROBABILITY: cause.probability} if told and not stands_for else {}
    if stands_for:
        why = stands_for
    elif confirmed and material and not told:
        why = "its figures may as well be none"
    text = f"{values}: {why} ({100 * size.force:.2g} % of weight, {100 * size.torque:.2g} % of torque)"
    return Finding(cause.identifier, text, size.gap, figures)


def _cause(ranking, fit: Fit, i: int, term: Term, flights, same, size: Size, held) -> Cause:
    effect = term.effect
    parameters = {}
    for p in effect.parameters:
        value, (lower, upper) = float(getattr(effect, p.name)), interval(fit, i, p.name)
        half = 0.5 * (upper - lower)
        if term.swings:
            half = float(np.hypot(half, 1.96 * pendulum_error(p.name, value, real=ranking.tolerance.real)))
        parameters[p.name] = Estimate(value, p.unit, (value - half, value + half))
    return Cause(
        effect.identifier,
        calibrated_probability(ranking.probability, (effect.identifier, *same.get(effect.identifier, ()))),
        parameters,
        {e.name: held.terms.get(e.name, fit.everything)[i].begins(e.name) for e in flights},
        same.get(effect.identifier, ()),
        size.gap,
        effect,
    )


def log_bayes_factor(
    fit: Fit, i: int, flights: Sequence[FlightResiduals], noise: NoiseModel, held: HeldOut, drift: Drift
) -> float:
    """Log evidence that term i brings on the held-out flights, whatever their own sensors are off by.

    What acts throughout the flights of the fit, but not in one of these, must bring there what its onset had to.
    """
    brought = sum(
        _log_bayes_factor_on(held.whole_flight_terms[e.name], i, e, noise, held.rows[e.name], drift)
        for e in flights
    )
    late = sum(held.terms[e.name][i].begins(e.name) is not None for e in flights)
    return brought if set(fit.terms[i].onset.values()) - {None} else brought - SURPRISE * late


def _log_bayes_factor_on(
    terms: Sequence[Term], i: int, e: FlightResiduals, noise: NoiseModel, rows: np.ndarray, drift: Drift
) -> float:
    """Log evidence that terms[i] brings to the others on these rows (m,) of a flight."""
    if terms[i].begins(e.name) == NEVER:
        return 0.0
    without = e.y - predicted_residual(e, [t for j, t in enumerate(terms) if j != i])
    losses = [loss_on(e, r, noise, rows, drift) for r in (without, e.y - predicted_residual(e, terms))]
    return 0.5 * (losses[0] - losses[1])


def least_log_bayes_factor(
    fit: Fit, i: int, flights: Sequence[FlightResiduals], noise: NoiseModel, drift: Drift
) -> float:
    """Log evidence on held-out flights below which term i is not confirmed by them.

    Where a flight does not excite an effect, its columns are the noise of what is measured, and it explains nothing
    there: that may cost a share of what the term brings to the flights of the fit.
    """
    brought = sum(
        _log_bayes_factor_on(fit.everything, i, e, noise, np.ones(len(e.t), bool), drift) for e in flights
    )
    return -(HURT + MISFIT * max(brought, 0.0))
