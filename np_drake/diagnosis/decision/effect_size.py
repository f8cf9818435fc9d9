"""Size of an effect in force, torque, gap and sensor tolerance."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.fitting import Fit
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.materiality import Size
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.residuals import flight_residuals as ev
from np_drake.diagnosis.tolerance import Tolerance


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
