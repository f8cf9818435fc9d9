"""Size of an effect in force, torque, gap and sensor tolerance."""

from collections.abc import Sequence

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.fitting import Fit, scaled_jacobian
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Materiality, Options, Size, Tolerance
from np_drake.diagnosis.residuals import FORCE, WRENCH, FlightResiduals
from np_drake.diagnosis.residuals import flight_residuals as ev


def size_of(
    fit: Fit,
    i: int,
    flights: Sequence[FlightResiduals],
    noise: NoiseModel,
    tolerance: Tolerance,
    unseen: Sequence[tuple[FlightResiduals, Sequence[Term]]] = (),
) -> Size:
    """Return the size of term i over training and held-out flights; its gap counts training flights alone.

    unseen: held-out flights with their adapted terms.

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
        float(np.linalg.norm(list(effect.values.values()))) / max(tolerance.of(effect), 1e-9),
    )


def within_calibration(term: Term, options: Options) -> bool:
    """Return whether the term is what a vehicle file may be off by; not if it begins in flight."""
    late = any(begin is not None for begin in term.onset.values())
    stated = term.effect.tolerance and term.effect.place != "measurement"
    return bool(stated) and options.tolerance.real and not late


DRAWS = 400  # of the posterior
SEED = 1


def relative_sizes(fit: Fit, i: int, flights: Sequence[FlightResiduals]) -> np.ndarray:
    """Return draws (`DRAWS`,) of the size of term i from its posterior, over its size at the fit [1].

    The size is the RMS of what the term's parameters predict, linear in their distance from none.
    Source: Laplace approximation.
    """
    names = {p.name for p in fit.terms[i].effect.parameters if p.vanishes}
    own = [k for k, f in enumerate(fit.free) if f.term == i and not f.flight and f.name in names]
    away = np.array([fit.values[k] - fit.free[k].neutral for k in own])
    free = [fit.free[k] for k in own]
    scale = np.array([f.scale for f in free])
    columns = [scaled_jacobian(fit.everything, free, e)[:, WRENCH].reshape(-1, len(own)) for e in flights]
    power = sum(J.T @ J for J in columns) / np.outer(scale, scale)
    if not power.any():  # a sensor error that no wrench shows
        power = np.diag(scale**-2.0)
    draws = np.random.default_rng(SEED).multivariate_normal(away, fit.covariance[np.ix_(own, own)], DRAWS)
    at_fit = float(away @ power @ away)
    squares = np.einsum("ni,ij,nj->n", draws, power, draws)
    return np.sqrt(np.maximum(squares, 0.0) / max(at_fit, 1e-300))


def wind_share(fit: Fit, i: int, flights: Sequence[FlightResiduals], still_air: float, lean: float) -> float:
    """Return the posterior probability that the mean level wind of term i is none of still air; 1 where it is no wind.

    It is faster than a draught, and pushes harder than an attitude error that the sensors may have.

    Args:
        fit, i, flights: term i of a fit to these flights.
        still_air: largest speed of a draught [m/s].
        lean: attitude error that the sensors may have, under which thrust pushes as a wind does [rad].
    """
    own = {f.name: k for k, f in enumerate(fit.free) if f.term == i and not f.flight}
    if not fit.terms[i].effect.needs or not {"x", "y"} <= set(own):
        return 1.0
    level = [own["x"], own["y"]]
    covariance = fit.covariance[np.ix_(level, level)]
    draws = np.random.default_rng(SEED).multivariate_normal(fit.values[level], covariance, DRAWS)
    speed, at_fit = np.linalg.norm(draws, axis=1), float(np.linalg.norm(fit.values[level]))
    weight = flights[0].vehicle.mass * flights[0].vehicle.gravity
    least = lean * weight * at_fit / max(_mean_level_force(fit, i, flights), 1e-12)
    return float(np.mean(speed > max(still_air, least)))


def _mean_level_force(fit: Fit, i: int, flights: Sequence[FlightResiduals]) -> float:
    """Return the size of the mean level force of term i in W while it acts, over all flights [N]."""
    rest = [t for j, t in enumerate(fit.everything) if j != i]
    forces = []
    for e in flights:
        part = predicted_residual(e, fit.everything) - predicted_residual(e, rest)
        begin = fit.terms[i].begins(e.name)
        acts = e.t >= (-np.inf if begin is None else begin)
        forces.append(attitude.rotate(e.q, part[:, FORCE])[acts])
    return float(np.linalg.norm(np.concatenate(forces).mean(axis=0)[:2]))


def material_share(
    size: Size, relative: np.ndarray, materiality: Materiality, *, calibration: bool, sensor: bool
) -> float:
    """Return the posterior probability that an effect is larger than what is practically none [1].

    Args:
        size: at the fit.
        relative: draws (n,) of the size over that at the fit [1].
        calibration, sensor: as in `Size.material`.
    """
    sizes = (Size(size.force * r, size.torque * r, size.gap * r**2, size.sensor * r) for r in relative)
    found = [s.material(materiality, calibration=calibration, sensor=sensor) for s in sizes]
    return float(np.mean(found))
