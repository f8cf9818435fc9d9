"""Assessment of one term of the best model: its size, how probable it is, and how probably
material.
"""

import dataclasses as dc
from collections.abc import Collection, Mapping, Sequence

import numpy as np
from scipy import special

from np_drake import attitude
from np_drake.diagnosis.calibration import healthy_spread
from np_drake.diagnosis.decision.support import Support
from np_drake.diagnosis.decision.unexplained import LinearModel
from np_drake.diagnosis.fitting import Fit, greatest_height, impossible, scaled_jacobian
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import SPREAD, Options, Size, Tolerance, unhealthy
from np_drake.diagnosis.regressors import DRAG
from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals
from np_drake.diagnosis.selection import Ranking
from np_drake.files.number_text import number, probability

DRAWS = 400  # of the posterior
SEED = 1


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
    effect, tolerance = term.effect, options.tolerance
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
        posterior = SizePosterior(fit, i, flights)
        spread = healthy_spread(effect, flights[0], tolerance, changed=has_changed(ranking, i))
        outside = (
            posterior.material(size, options),
            posterior.beyond(spread),
            posterior.blows(options),
        )
        # Their product: what two bounds leave in doubt is not sure of either.
        material = float(np.prod([np.mean(own) for own in outside]))
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


class SizePosterior:
    """Draws of the parameters of a term from its posterior, and which of them are more than what is
    practically none.

    Source: Laplace approximation.
    """

    def __init__(self, fit: Fit, i: int, flights: Sequence[FlightResiduals]):
        self._fit, self._i, self._flights = fit, i, flights
        own = [k for k, f in enumerate(fit.free) if f.term == i and not f.flight]
        self._free, self._values = [fit.free[k] for k in own], fit.values[own]
        covariance = fit.covariance[np.ix_(own, own)]
        self.draws = np.random.default_rng(SEED).multivariate_normal(
            self._values, covariance, DRAWS
        )

    def _places(self, names: Collection[str]) -> list[int]:
        return [k for k, f in enumerate(self._free) if f.name in names]

    def relative(self) -> np.ndarray:
        """Return the size over that at the fit (n,) [1].

        It is the RMS of what the term's parameters predict, linear in their distance from none.
        """
        effect = self._fit.terms[self._i].effect
        own = self._places([p.name for p in effect.parameters if p.vanishes])
        if not own:
            return np.ones(len(self.draws))
        free = [self._free[k] for k in own]
        scale, neutral = (np.array([getattr(f, of) for f in free]) for of in ("scale", "neutral"))
        columns = [
            scaled_jacobian(self._fit.everything, free, e)[:, WRENCH].reshape(-1, len(own))
            for e in self._flights
        ]
        # The squared size is the quadratic form d' P d of the distance d from none, P = sum J'J
        # over the flights.
        power = sum(J.T @ J for J in columns) / np.outer(scale, scale)
        if not power.any():  # a sensor error that no wrench shows
            power = np.diag(scale**-2.0)
        away, at_fit = self.draws[:, own] - neutral, self._values[own] - neutral
        squares = np.einsum("ni,ij,nj->n", away, power, away)
        return np.sqrt(np.maximum(squares, 0.0) / max(float(at_fit @ power @ at_fit), 1e-300))

    def material(self, size: Size, options: Options) -> np.ndarray:
        """Return which draws (n,) matter to the motion, or are beyond the tolerance of a sensor.

        Args:
            size: of the term at the fit.
        """
        term, least, relative = self._fit.terms[self._i], options.materiality, self.relative()
        if within_calibration(term, options):
            return size.force * relative >= least.calibration_force
        if options.tolerance.of(term.effect) > 0:
            return size.sensor * relative >= least.sensor
        return (size.force * relative >= least.force) | (size.torque * relative >= least.torque)

    def beyond(self, spread: Mapping[str, tuple[float, float]]) -> np.ndarray:
        """Return which draws (n,) are larger than healthy vehicles differ by.

        Args:
            spread: usual value and deviation of parameters by name; empty: there is no such thing.
        """
        own = self._places(spread)
        if not own:
            return np.ones(len(self.draws), bool)
        usual, deviation = np.array([spread[self._free[k].name] for k in own]).T
        away = (self.draws[:, own] - usual) / deviation
        return np.linalg.norm(away, axis=1) > unhealthy(len(own))

    def blows(self, options: Options) -> np.ndarray:
        """Return which draws (n,) are more than still air, where the term is a wind.

        The mean level wind is faster than a draught, and pushes harder than an attitude error that
        the sensors may have, under which thrust pushes as a wind does.
        """
        level, effect = self._places(("x", "y")), self._fit.terms[self._i].effect
        if not effect.needs or len(level) < 2:
            return np.ones(len(self.draws), bool)
        tolerance, least = options.tolerance, options.materiality
        # Of the attitude against the rotors' axes, all together [rad].
        tilt = SPREAD.tilt if tolerance.unmeasured else tolerance.attitude
        mounting = SPREAD.mounting if tolerance.unmeasured else tolerance.mounting
        error = least.sensor * float(np.hypot(tilt, mounting)) * self._flights[0].weight
        forces = []  # in W while it acts
        for e in self._flights:
            begin = self._fit.terms[self._i].begins(e.name)
            acts = e.t >= (-np.inf if begin is None else begin)
            part = _part_of(self._fit.everything, self._i, e)
            forces.append(attitude.rotate(e.q, part[:, FORCE])[acts])
        force = float(np.linalg.norm(np.concatenate(forces).mean(axis=0)[:2]))
        speed = np.linalg.norm(self.draws[:, level], axis=1)
        slowest = error * float(np.linalg.norm(self._values[level])) / max(force, 1e-12)
        return speed > max(least.still_air, slowest)
