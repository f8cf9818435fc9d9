"""Assessment of one term of the best model: its size, how probable it is, and how probably
material.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from scipy import special

from np_drake import attitude
from np_drake.diagnosis.calibration import DRAWS, SEED, beyond_spread
from np_drake.diagnosis.decision.support import Support
from np_drake.diagnosis.decision.unexplained import LinearModel
from np_drake.diagnosis.fitting import Fit, greatest_height, impossible, scaled_jacobian
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import SPREAD, Materiality, Options, Size, Tolerance
from np_drake.diagnosis.regressors import DRAG
from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals
from np_drake.diagnosis.selection import Ranking
from np_drake.files.number_text import number, probability


@dc.dataclass(frozen=True)
class TermAssessment:
    """What is known of a term of the best model.

    support: its gain in prediction; None: not asked.
    in_model: probability that it acts, against other effects and generic structure in its place
        [1].
    material: probability that it is larger than what is practically none, given that it acts [1].
    size: at the fit.   stands_for: why its parameters are not physical; empty where they are.
    """

    in_model: float
    material: float
    size: Size
    stands_for: str
    support: Support | None = None

    @property
    def probability(self) -> float:
        """Probability of a cause [1]; what held-out flights contradict is never more probable than
        not.
        """
        if self.stands_for:
            return 0.0
        predicts = 1.0 if self.support is None else self.support.probability
        share = 0.5 if self.support is not None and self.support.contradicted else 1.0
        return self.in_model * self.material * predicts * share

    @property
    def reason(self) -> str:
        """Why it is below the threshold of a cause."""
        support = self.support
        if self.stands_for:
            return self.stands_for
        if support is not None and support.contradicted:
            return "held-out flights are predicted better without it"
        if support is not None and support.probability < min(self.material, self.in_model):
            gain, error = number(support.total, 2), number(support.error, 2)
            return f"it does not predict: {gain} ± {error} nat in time that did not fit it"
        unsure = f"not sure, {probability(self.in_model)}"
        return "immaterial" if self.material < self.in_model else unsure


def assess_term(
    ranking: Ranking,
    linear: LinearModel,
    structure: Sequence[int],
    i: int,
    same: Sequence[str],
    held: HeldOut,
    *,
    support: Support | None = None,
    gusts: bool = False,
) -> TermAssessment:
    """Assess term i of the best model.

    same: effects that cannot be told from term i, whose probability is added.
    gusts: whether the slow force is that of gusts. The drag through which they act is material and
    stands for nothing else; its prior is that of gusts against structure that is no effect.
    """
    fit, flights, options = ranking.best, ranking.problem.flights, ranking.options
    term, vehicle, priors = fit.terms[i], flights[0].vehicle, options.priors
    effect, tolerance, materiality = term.effect, options.tolerance, options.materiality
    named = min(1.0, sum(ranking.probability.get(name, 0.0) for name in (effect.identifier, *same)))
    through_drag = gusts and effect.identifier == DRAG
    brought = priors.generic - priors.of_effect(DRAG) if through_drag else 0.0
    in_model = named * float(special.expit(linear.margin(i, structure) + brought))
    unseen = [(e, held.terms[e.name]) for e in held.flights]
    later = [e for e in flights if not e.earlier]
    size = size_of(fit, i, later, ranking.noise.rms, tolerance, unseen)
    if through_drag:
        return TermAssessment(in_model, 1.0, size, "")
    material = 0.0
    if not options.within_timing(effect, vehicle):
        material = material_share(
            size,
            relative_sizes(fit, i, flights),
            materiality,
            calibration=within_calibration(term, options),
            sensor=tolerance.of(effect) > 0,
        )
        # Of the attitude against the rotors' axes, all together [rad].
        tilt = SPREAD.tilt if tolerance.unmeasured else tolerance.attitude
        mounting = SPREAD.mounting if tolerance.unmeasured else tolerance.mounting
        error = materiality.sensor * float(np.hypot(tilt, mounting))
        material *= wind_share(fit, i, flights, materiality.still_air, error)
        changed = has_changed(ranking, i)
        material *= beyond_spread(fit, i, flights[0], tolerance, changed=changed)
    stands_for = impossible(fit, i, vehicle, greatest_height(flights))
    return TermAssessment(in_model, material, size, stands_for, support)


def has_changed(ranking: Ranking, i: int) -> bool:
    """Return whether term i of the best model is practically nothing in the flights from before
    what is asked.
    """
    earlier = [e for e in ranking.problem.flights if e.earlier]
    if not earlier:
        return False
    options, rms = ranking.options, ranking.noise.rms
    size, least = size_of(ranking.best, i, earlier, rms, options.tolerance), options.materiality
    return size.force < least.force and size.torque < least.torque


def size_of(
    fit: Fit,
    i: int,
    flights: Sequence[FlightResiduals],
    rms: np.ndarray,
    tolerance: Tolerance,
    unseen: Sequence[tuple[FlightResiduals, Sequence[Term]]] = (),
) -> Size:
    """Return the size of term i over training and held-out flights; its gap counts training flights
    alone.

    What does little where it was fitted may do much elsewhere, as a drag in a flight that is
    faster. A half of a flight that joined the fit counts in both.

    Args:
        rms: (15,) of the noise.
    Source: own choice.
    """
    force = torque = command = rows = own = gap = 0.0
    inverse = np.where(rms > 0, 1.0 / np.maximum(rms, 1e-12), 0.0)
    fitted = [(e, fit.everything) for e in flights]
    for k, (e, terms) in enumerate([*fitted, *unseen]):
        part = _part_of(terms, i, e)
        force += np.sum(part[:, FORCE] ** 2)
        torque += np.sum(part[:, TORQUE] ** 2)
        command += np.sum((e.nominal[:, 3:] - e.nominal[:, 3:].mean(axis=0)) ** 2)
        rows += len(part)
        if k < len(fitted):
            own += np.sum((part * inverse) ** 2)
            gap += np.sum((e.y * inverse) ** 2) - e.y.shape[0] * np.sum(rms > 0)
    effect = fit.terms[i].effect
    return Size(
        float(np.sqrt(force / rows)) / flights[0].weight,
        float(np.sqrt(torque / max(command, 1e-12))),
        float(own / max(gap, own, 1e-9)),
        float(np.linalg.norm(list(effect.values.values()))) / max(tolerance.of(effect), 1e-9),
    )


def _part_of(terms: Sequence[Term], i: int, flight: FlightResiduals) -> np.ndarray:
    """Return the part (m, 15) of the terms' predicted residual that is due to term i."""
    rest = [t for j, t in enumerate(terms) if j != i]
    return predicted_residual(flight, terms) - predicted_residual(flight, rest)


def within_calibration(term: Term, options: Options) -> bool:
    """Return whether the term is what a vehicle file may be off by; not if it begins in flight."""
    late = any(begin is not None for begin in term.onset.values())
    stated = term.effect.tolerance and term.effect.place != "measurement"
    return bool(stated) and options.tolerance.real and not late


def relative_sizes(fit: Fit, i: int, flights: Sequence[FlightResiduals]) -> np.ndarray:
    """Return draws (`DRAWS`,) of the size of term i from its posterior, over its size at the fit
    [1].

    The size is the RMS of what the term's parameters predict, linear in their distance from none.
    Source: Laplace approximation.
    """
    names = {p.name for p in fit.terms[i].effect.parameters if p.vanishes}
    own = [k for k, f in enumerate(fit.free) if f.term == i and not f.flight and f.name in names]
    away = np.array([fit.values[k] - fit.free[k].neutral for k in own])
    free = [fit.free[k] for k in own]
    scale = np.array([f.scale for f in free])
    columns = [
        scaled_jacobian(fit.everything, free, e)[:, WRENCH].reshape(-1, len(own)) for e in flights
    ]
    # The squared size is the quadratic form d' P d of the distance d from none, P = sum J'J over
    # the flights.
    power = sum(J.T @ J for J in columns) / np.outer(scale, scale)
    if not power.any():  # a sensor error that no wrench shows
        power = np.diag(scale**-2.0)
    draws = np.random.default_rng(SEED).multivariate_normal(
        away, fit.covariance[np.ix_(own, own)], DRAWS
    )
    at_fit = float(away @ power @ away)
    squares = np.einsum("ni,ij,nj->n", draws, power, draws)
    return np.sqrt(np.maximum(squares, 0.0) / max(at_fit, 1e-300))


def wind_share(
    fit: Fit, i: int, flights: Sequence[FlightResiduals], still_air: float, attitude_error: float
) -> float:
    """Return the posterior probability that the mean level wind of term i is none of still air; 1
    where it is no wind.

    It is faster than a draught [m/s], and pushes harder than an attitude error that the sensors may
    have [rad], under which thrust pushes as a wind does.
    """
    own = {f.name: k for k, f in enumerate(fit.free) if f.term == i and not f.flight}
    if not fit.terms[i].effect.needs or not {"x", "y"} <= set(own):
        return 1.0
    level = [own["x"], own["y"]]
    covariance = fit.covariance[np.ix_(level, level)]
    draws = np.random.default_rng(SEED).multivariate_normal(fit.values[level], covariance, DRAWS)
    speed, at_fit = np.linalg.norm(draws, axis=1), float(np.linalg.norm(fit.values[level]))
    forces = []  # in W while it acts
    for e in flights:
        part, begin = _part_of(fit.everything, i, e), fit.terms[i].begins(e.name)
        acts = e.t >= (-np.inf if begin is None else begin)
        forces.append(attitude.rotate(e.q, part[:, FORCE])[acts])
    force = float(np.linalg.norm(np.concatenate(forces).mean(axis=0)[:2]))
    least = attitude_error * flights[0].weight * at_fit / max(force, 1e-12)
    return float(np.mean(speed > max(still_air, least)))


def material_share(
    size: Size, relative: np.ndarray, materiality: Materiality, *, calibration: bool, sensor: bool
) -> float:
    """Return the posterior probability that an effect is larger than what is practically none [1].

    relative: draws (n,) of the size over that at the fit [1]. calibration: whether the effect is
    what a vehicle file may be off by.
    """
    if calibration:
        large = size.force * relative >= materiality.calibration_force
    elif sensor:
        large = size.sensor * relative >= materiality.sensor
    else:
        force, torque = size.force * relative, size.torque * relative
        large = (force >= materiality.force) | (torque >= materiality.torque)
    return float(np.mean(large))
