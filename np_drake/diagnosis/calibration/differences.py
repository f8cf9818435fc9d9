"""What the calibration of the best fit says: how the vehicle differs from its file, and a flight
from its vehicle.
"""

import dataclasses as dc
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from np_drake.diagnosis.calibration.columns import drift_columns
from np_drake.diagnosis.calibration.spread import (
    SURE,
    Deviation,
    of_flight,
    of_vehicle,
    parameter_names,
)
from np_drake.diagnosis.fitting import Fit
from np_drake.diagnosis.fitting.map_estimate import LinearPart
from np_drake.diagnosis.options import SPREAD, Tolerance
from np_drake.diagnosis.regressors import calibration_terms
from np_drake.diagnosis.regressors.nuisance import THROTTLE_CURVE
from np_drake.diagnosis.residuals import FORCE, TORQUE, FlightResiduals
from np_drake.diagnosis.result import Difference
from np_drake.effects.base import Effect, Parameter
from np_drake.effects.mixer_gain import MixerGain
from np_drake.effects.throttle_curve import ThrottleCurve
from np_drake.files.number_text import departure_unit, measure, number, with_sign
from np_drake.logs.inputs import hover_exponent

AXES = 2  # last columns of the airframe: thrust that leans to x and y
# half of an interval over the value, above which an exponent is hardly told [1]; own choice
HARDLY = 0.25


def differences(
    fit: Fit, flights: Sequence[FlightResiduals], tolerance: Tolerance
) -> tuple[Difference, ...]:
    """Return what an unmeasured vehicle and its flights differ by, the largest in standard
    deviations first.
    Returns: where the file describes the vehicle that flew, the map of its throttle alone, if that
        is the input.
    """
    of_throttle = _throttle_map(fit, flights[0])
    if not tolerance.unmeasured:
        return tuple(of_throttle)
    *errors, body, air = fit.linear
    found = [
        *of_throttle,
        *_of_file(fit, flights[0], tolerance),
        *_of_parameters(body, of_vehicle(flights[0], tolerance), flights[0].torque_share),
        *_of_airframe(air, flights),
        *_of_flights(dict(zip((e.name for e in flights), errors, strict=True)), flights, tolerance),
    ]
    return tuple(sorted(found, key=lambda d: -d.in_deviations))


def _of_file(fit: Fit, e: FlightResiduals, tolerance: Tolerance) -> Iterator[Difference]:
    """Yield errors of mass, thrust and input within the tolerance of the file."""
    priors = calibration_terms(e.vehicle, tolerance)
    for i, (term, (_, deviation)) in enumerate(zip(fit.calibration, priors, strict=True)):
        for p in term.effect.parameters:
            if isinstance(term.effect, ThrottleCurve):
                continue
            sigma = _deviation_of(fit, i, p.name)
            value = getattr(term.effect, p.name) - p.neutral
            yield _difference(
                f"{term.effect.identifier}.{p.name}",
                type(term.effect),
                p,
                {},
                value,
                sigma,
                deviation,
            )


def _deviation_of(fit: Fit, i: int, name: str) -> float:
    """Return the standard deviation of a parameter of calibration term i; NaN where it is fixed."""
    own = [k for k, f in enumerate(fit.free) if (f.term, f.name) == (len(fit.terms) + i, name)]
    return float(np.sqrt(fit.covariance[own[0], own[0]])) if own else np.nan


def _throttle_map(fit: Fit, e: FlightResiduals) -> list[Difference]:
    """Return the power of throttle with which thrust goes, over that of the nominal map; none of
    another input.
    """
    found = []
    for i, term in enumerate(fit.calibration):
        if isinstance(term.effect, ThrottleCurve):
            nominal = hover_exponent(e.vehicle)
            value, half = (
                nominal * (1 + term.effect.curve),
                SURE * nominal * _deviation_of(fit, i, "curve"),
            )
            told = f"thrust goes with the power {number(value, 3)} of throttle"
            text = (
                told if half < HARDLY * value else "the power of throttle in thrust is hardly told"
            )
            ci95 = (value - nominal - half, value - nominal + half)
            found.append(
                Difference(
                    "throttle_curve.curve",
                    text,
                    value - nominal,
                    "1",
                    THROTTLE_CURVE * nominal,
                    ci95,
                )
            )
    return found


def _of_parameters(
    part: LinearPart,
    deviations: Sequence[Deviation],
    share: Mapping[str, float] = MappingProxyType({}),
) -> list[Difference]:
    """Return the parameters of deviations; the lags of rotors, which each act by a share, as
    one.
    """
    lags = [d for d in deviations if d.at_value]
    names, found, k = parameter_names(list(deviations)), [], 0
    for d in deviations:
        parameters = {p.name: p for p in d.effect.parameters}
        for name, deviation in d.deviation.items():
            if not d.at_value:
                value, sigma = (
                    part.coefficients[k] * deviation,
                    np.sqrt(part.covariance[k, k]) * deviation,
                )
                if d.effect is MixerGain:  # of the share of torque that the motion shows
                    value, sigma = share[name] * (1.0 + value) - 1.0, share[name] * sigma
                found.append(
                    _difference(
                        names[k], d.effect, parameters[name], d.fixed, value, sigma, deviation
                    )
                )
            k += 1
    if lags:
        own = slice(k - len(lags), k)
        time = np.array([next(iter(d.deviation.values())) for d in lags])
        value, sigma = (
            part.coefficients[own] @ time,
            np.sqrt(time @ part.covariance[own, own] @ time),
        )
        effect, norm = lags[0].effect, float(np.linalg.norm(time))
        found.append(_difference(names[-1], effect, effect.parameters[0], {}, value, sigma, norm))
    return found


def _of_airframe(part: LinearPart, flights: Sequence[FlightResiduals]) -> list[Difference]:
    """Return how thrust leans, and the RMS of what goes smoothly with velocity, body rate and
    thrust.
    """
    assert part.columns is not None
    found = []
    for k, (more, less) in enumerate(
        (("ahead", "back"), ("to the left", "to the right")), start=-AXES
    ):
        value, sigma = (
            SPREAD.mounting * v for v in (part.coefficients[k], np.sqrt(part.covariance[k, k]))
        )
        p = Parameter(
            "xy"[k],
            "rad",
            0.0,
            -1.0,
            1.0,
            1.0,
            departure=f"thrust leans {{size}} {more}|thrust leans {{size}} {less}",
        )
        found.append(
            _difference(f"thrust_axis.{p.name}", Effect, p, {}, value, sigma, SPREAD.mounting)
        )
    columns = np.concatenate([part.columns(e)[..., :-AXES] for e in flights])
    text = "airframe: {kind} of {size} RMS that goes with velocity, body rate and thrust"
    return [
        *found,
        *_root_mean_square("airframe", text, {"": (columns, part.coefficients[:-AXES])}),
    ]


def _of_flights(
    parts: Mapping[str, LinearPart], flights: Sequence[FlightResiduals], tolerance: Tolerance
) -> list[Difference]:
    """Return what flights differ by, each parameter with its value in every flight and the words of
    the largest.
    """
    each: dict[str, dict[str, Difference]] = {}
    drift = {}
    for e in flights:
        deviations = of_flight(e, tolerance)
        for d in _of_parameters(parts[e.name], deviations):
            each.setdefault(d.name, {})[e.name] = d
        columns = drift_columns(e)
        drift[e.name] = columns, parts[e.name].coefficients[-columns.shape[-1] :]
    return [
        *map(_largest, each.values()),
        *_root_mean_square("drift", "{kind} that drifts by {size} RMS", drift),
    ]


def _largest(of: Mapping[str, Difference]) -> Difference:
    name = max(of, key=lambda flight: of[flight].in_deviations)
    values = {flight: d.value for flight, d in of.items()}
    return dc.replace(of[name], text=f"{of[name].text} in {name}", by_flight=values)


def _root_mean_square(
    name: str, text: str, parts: Mapping[str, tuple[np.ndarray, np.ndarray]]
) -> list[Difference]:
    """Return the RMS force and torque of columns with their coefficients, and what it is under
    their prior.
    """
    found = []
    for kind, channels, unit in (("force", FORCE, "N"), ("torque", TORQUE, "N·m")):
        of = {}
        for flight, (columns, coefficients) in parts.items():
            X = columns[:, channels]
            value = float(np.sqrt(np.mean(np.sum((X @ coefficients) ** 2, axis=1))))
            deviation = float(np.sqrt(np.mean(np.sum(X**2, axis=(1, 2)))))
            said = text.format(kind=kind, size=measure(value, unit))
            of[flight] = Difference(f"{name}.{kind}", said, value, unit, deviation)
        found.append(_largest(of) if "" not in of else of[""])
    return found


def _difference(
    name: str,
    effect: type[Effect],
    p: Parameter,
    fixed: Mapping[str, float],
    value: float,
    sigma: float,
    deviation: float,
) -> Difference:
    """Return a departure from the neutral value in words."""
    unit = "share" if p.unit == "1" and effect.shares else p.unit
    more, _, less = p.departure.partition("|")
    factor, shown = departure_unit(unit)
    size = measure(factor * abs(value), shown)
    words = less if less and value < 0 else more
    text = words.format(
        size=size, signed=with_sign(size, value), **{n: f"{v:g}" for n, v in fixed.items()}
    )
    ci95 = (float(value - SURE * sigma), float(value + SURE * sigma))
    return Difference(name, text, float(value), unit or "1", float(deviation), ci95)
