"""Size of an effect of the best model, and which draws of its posterior are more than what is
practically none.
"""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.calibration import healthy_spread
from np_drake.diagnosis.fitting import Fit, scaled_jacobian
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.options import SPREAD, Options, Size, unhealthy
from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals
from np_drake.diagnosis.selection import Ranking

DRAWS = 400  # of the posterior
SEED = 1


def has_changed(ranking: Ranking, i: int) -> bool:
    """Return whether term i of the best model is practically nothing in the flights from before
    what is asked.
    """
    earlier = [e for e in ranking.problem.flights if e.earlier]
    if not earlier:
        return False
    size, least = size_of(ranking, i, earlier), ranking.options.materiality
    return size.force < least.force and size.torque < least.torque


def size_of(
    ranking: Ranking,
    i: int,
    flights: Sequence[FlightResiduals],
    unseen: Sequence[tuple[FlightResiduals, Sequence[Term]]] = (),
) -> Size:
    """Return the size of term i over training and held-out flights; its gap counts training flights
    alone.

    What does little where it was fitted may do much elsewhere, as a drag in a flight that is
    faster. A half of a flight that joined the fit counts in both.

    Args:
        unseen: held-out flights with the terms as they are there.
    Source: own choice.
    """
    fit, rms = ranking.best, ranking.noise.rms
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
    tolerance = max(ranking.options.tolerance.of(effect), 1e-9)
    return Size(
        float(np.sqrt(force / rows)) / flights[0].weight,
        float(np.sqrt(torque / max(command, 1e-12))),
        float(own / max(gap, own, 1e-9)),
        float(np.linalg.norm(list(effect.values.values()))) / tolerance,
    )


def _part_of(terms: Sequence[Term], i: int, flight: FlightResiduals) -> np.ndarray:
    """Return the part (m, 15) of the terms' predicted residual that is due to term i."""
    rest = [t for j, t in enumerate(terms) if j != i]
    return predicted_residual(flight, terms) - predicted_residual(flight, rest)


def probably_material(ranking: Ranking, i: int, size: Size) -> float:
    """Return the probability that term i of the best model, of this size at the fit, is more than
    what is practically none, given that it acts [1].
    """
    fit, flights, options = ranking.best, ranking.problem.flights, ranking.options
    effect = fit.terms[i].effect
    if options.within_timing(effect, flights[0].vehicle):
        return 0.0
    posterior, changed = SizePosterior(fit, i, flights), has_changed(ranking, i)
    spread = healthy_spread(effect, flights[0], options.tolerance, changed=changed)
    outside = (
        posterior.material(size, options),
        posterior.beyond(spread),
        posterior.blows(options),
    )
    # Their product: what two bounds leave in doubt is not sure of either.
    return float(np.prod(np.mean(outside, axis=1)))


class SizePosterior:
    """Draws of the parameters of a term from its posterior, and which of them are more than what is
    practically none.

    Source: Laplace approximation.
    """

    def __init__(self, fit: Fit, i: int, flights: Sequence[FlightResiduals]):
        self._fit, self._i, self._flights, self._term = fit, i, flights, fit.terms[i]
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
        own = self._places([p.name for p in self._term.effect.parameters if p.vanishes])
        if not own:
            return np.ones(len(self.draws))
        free = [self._free[k] for k in own]
        scale, neutral = np.array([(f.scale, f.neutral) for f in free]).T
        # The squared size is the quadratic form d' P d of the distance d from none, P = sum J'J
        # over the flights.
        power = np.zeros((len(own), len(own)))
        for e in self._flights:
            columns = scaled_jacobian(self._fit.everything, free, e)[:, WRENCH]
            J = columns.reshape(-1, len(own)) / scale
            power += J.T @ J
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
        effect, least, relative = self._term.effect, options.materiality, self.relative()
        if options.tolerance.of(effect) > 0:
            return size.sensor * relative >= least.sensor
        late = any(begin is not None for begin in self._term.onset.values())
        if (
            effect.tolerance
            and effect.place != "measurement"
            and options.tolerance.real
            and not late
        ):
            # A vehicle file may be off by as much.
            return size.force * relative >= least.calibration_force
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
        level = self._places(("x", "y"))
        if not self._term.effect.needs or len(level) < 2:
            return np.ones(len(self.draws), bool)
        tolerance, least = options.tolerance, options.materiality
        # Of the attitude against the rotors' axes, all together [rad].
        lean = (tolerance.attitude, tolerance.mounting)
        if tolerance.unmeasured:
            lean = (SPREAD.tilt, SPREAD.mounting)
        error = least.sensor * float(np.hypot(*lean)) * self._flights[0].weight
        forces = []  # in W while it acts
        for e in self._flights:
            begin = self._term.begins(e.name)
            acts = e.t >= (-np.inf if begin is None else begin)
            part = _part_of(self._fit.everything, self._i, e)
            forces.append(attitude.rotate(e.q, part[:, FORCE])[acts])
        force = float(np.linalg.norm(np.concatenate(forces).mean(axis=0)[:2]))
        speed = np.linalg.norm(self.draws[:, level], axis=1)
        slowest = error * float(np.linalg.norm(self._values[level])) / max(force, 1e-12)
        return speed > max(least.still_air, slowest)
