"""Noise of flights: what is left of their residuals when nuisance parameters and every effect help."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.doctor.traces import Trace
from np_drake.diagnosis.numerics import Gram, NoiseModel, scale_only
from np_drake.diagnosis.options import Options, Tolerance
from np_drake.diagnosis.regressors import DRAG, Candidate, calibration, sensor_drift, tolerance_of, with_input
from np_drake.diagnosis.residuals import WRENCH, FlightResiduals, find_shocks
from np_drake.diagnosis.result import CHANNELS
from np_drake.diagnosis.selection.initial_noise import noise_of

LEAST_DRAG = 2.0  # posterior deviations from which a drag is taken as that of the vehicle [1]


@dc.dataclass(frozen=True)
class Explained:
    """Flights with their outliers known, the noise model of what no effect explains, and the drag of the vehicle.

    floor: by channel of the wrench, RMS of what no effect explains [N, N·m].   drag: mean lateral drag that explains
    them best [N·s/m]; None where it is not told from zero.
    """

    flights: list[FlightResiduals]
    noise: NoiseModel
    floor: dict[str, float]
    drag: float | None


def explain(
    flights: Sequence[FlightResiduals],
    nuisance: Sequence[Candidate],
    traces: Sequence[Trace],
    options: Options,
) -> Explained:
    """Fit all traces and the nuisance together, and return what is left as noise.

    An effect that is in the logs does not count as noise; what no effect explains does.

    Args:
        flights: the flights.
        nuisance: nuisance columns, with prior N(0, 1).
        traces: one of each effect.
        options: tolerances of sensors, and the share of a linear prediction that is wrong.
    """
    blocks = [c.columns for c in nuisance] + [t.columns for t in traces]
    step = flights[0].grid.step
    _, _, residual = _fitted(flights, blocks, scale_only([e.y for e in flights], step))
    flights = [dc.replace(e, shocks=find_shocks(r, step)) for e, r in zip(flights, residual, strict=True)]
    raw = [e.bridged(e.y) for e in flights]
    _, _, residual = _fitted(flights, blocks, scale_only(raw, step))
    noise = noise_of(flights, residual, raw, options, options.priors.linear_error)
    mean, deviation, residual = _fitted(flights, blocks, noise)
    noise = noise_of(flights, residual, raw, options, options.priors.linear_error)
    floor = {name: float(noise.rms[WRENCH][c]) for c, name in enumerate(CHANNELS)}
    return Explained(list(flights), noise, floor, _drag(mean, deviation, nuisance, traces))


def _fitted(
    flights: Sequence[FlightResiduals], blocks: Sequence[dict[str, np.ndarray]], noise: NoiseModel
) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Return coefficients (k,), their deviations, and by flight the residual (m, 15) without outliers."""
    grams = [e.gram(noise, [b[e.name] for b in blocks]) for e in flights]
    total: Gram = sum(grams[1:], grams[0])
    mean, covariance = total.posterior(np.arange(len(total.Xy)))
    sizes = [next(iter(b.values())).shape[-1] for b in blocks]
    parts = np.split(mean, np.cumsum(sizes)[:-1])
    residual = [
        e.bridged(e.y - sum(b[e.name] @ part for b, part in zip(blocks, parts, strict=True))) for e in flights
    ]
    return mean, np.sqrt(np.diag(covariance)), residual


def _drag(mean, deviation, nuisance: Sequence[Candidate], traces: Sequence[Trace]) -> float | None:
    at = sum(c.size for c in nuisance)
    for trace in traces:
        if trace.identifier == DRAG:
            weight = deviation[at : at + 2] ** -2.0
            size = float(weight @ mean[at : at + 2] / weight.sum())
            return size * trace.typical[0] if size > LEAST_DRAG * weight.sum() ** -0.5 else None
        at += next(iter(trace.columns.values())).shape[-1]
    return None


def nuisance_of(flights: Sequence[FlightResiduals], tolerance: Tolerance) -> list[Candidate]:
    """Return errors of the vehicle file and of the sensors within tolerance, as columns with prior N(0, 1)."""
    drift = sensor_drift(flights, tolerance)
    return [*calibration(flights, tolerance), *([drift] if drift else [])]


def options_of(flights: Sequence[FlightResiduals], *, real: bool) -> Options:
    """Return the options of a diagnosis of these flights, with what their input leaves open.

    Args: real: sensors are real ones; else as the flights look.
    """
    options = Options.for_sensors(real or tolerance_of(flights).real)
    return with_input(options, flights)
