"""What truth.json holds of a case."""

import dataclasses as dc
from collections.abc import Sequence
from typing import Any

import numpy as np

from diagrams.challenge.generate.case import FILES, Case
from diagrams.challenge.generate.collinearity import (
    collinear_effects,
    effects_of_trace,
    is_calibration,
    is_calibration_trace,
)
from diagrams.challenge.generate.logged_input import best_known
from np_drake.diagnosis.forward_model.payload_state import Term
from np_drake.diagnosis.forward_model.prediction import gate, predicted_residual
from np_drake.diagnosis.numerics.noise_fit import fit_noise
from np_drake.diagnosis.numerics.noise_model import NoiseModel
from np_drake.diagnosis.options import Options, Priors, Tolerance
from np_drake.diagnosis.regressors import with_input
from np_drake.diagnosis.regressors.nuisance import tolerance_of
from np_drake.diagnosis.residuals.flight_residuals import FlightResiduals
from np_drake.diagnosis.residuals.make_flight_residuals import make_flight_residuals
from np_drake.effects.base import Effect
from np_drake.flight_log import FlightLog

AROUND = 4.0  # of the true onset, in which others are weighed [s]
SPAN = 0.4  # that is to hold the onset as likely as may be: twice the tolerance of the score [s]


def best_onset(
    exact: FlightResiduals, errors: np.ndarray, terms: Sequence[Term], onset: float, noise: NoiseModel
) -> float:
    """Return the middle of the span of `SPAN` that most likely holds the onset [s], under a uniform prior about it.

    Args:
        exact, errors: a flight without noise, (m, 15) what noise adds to its channels.
        terms: the true effects with the true onset [s].   noise: model of `errors`.
    """
    t, name = exact.t, exact.name
    begun = _left(exact, terms)
    always = _left(exact, [dc.replace(term, onset={**term.onset, name: None}) for term in terms])
    tried = np.flatnonzero(np.abs(t - onset) <= AROUND)
    cost = [
        float(np.sum(noise.whiten(errors + begun - _from(t, k, onset, begun, always)) ** 2)) for k in t[tried]
    ]
    likely = np.exp(-0.5 * (np.array(cost) - min(cost)))
    width = min(len(likely), max(1, round(SPAN / exact.grid.step)))
    first = int(np.argmax(np.convolve(likely, np.ones(width), "valid")))
    within = np.cumsum(likely[first : first + width])
    return float(t[tried[first + np.searchsorted(within, 0.5 * within[-1])]])


def _left(flight: FlightResiduals, terms: Sequence[Term]) -> np.ndarray:
    """Return what the terms leave (m, 15), in the channels that the log tells."""
    return flight.known(predicted_residual(flight, terms))


def _from(t: np.ndarray, k: float, onset: float, begun: np.ndarray, always: np.ndarray) -> np.ndarray:
    """Return the trace (m, 15) if it began at k: as it is where it has begun, as from the start before that."""
    return gate(t, k) * np.where(gate(t, onset) > 0, begun, always)


NO_GAP = 1.1  # residual over what the true model leaves, pooled: less is no gap [1]
CHANNELS = tuple(
    f"{kind}_{axis}" for kind in ("force", "torque", "velocity", "acceleration", "rate") for axis in "xyz"
)


@dc.dataclass(frozen=True)
class FlightPair:
    """The residuals of one flight as measured, and without noise on the same grid."""

    measured: FlightResiduals
    true: FlightResiduals

    @property
    def errors(self) -> np.ndarray:
        """Return what noise leaves to the true model (m, 15)."""
        return self.measured.y - self.true.y


def flight_pairs(
    case: Case, exact: dict[str, FlightLog], noisy: dict[str, FlightLog]
) -> dict[str, FlightPair]:
    """Return the pairs by file of the exact and noisy logs by file, which have the same rows."""
    return {file: flight_pair(case, file, exact[file], noisy[file]) for file in FILES}


def truth(case: Case, simulator: str, flights: dict[str, FlightPair]) -> dict:
    """Return the content of truth.json. flights: by file."""
    held_out = flights[FILES[-1]]
    residual, visibility = residual_and_visibility(case, held_out)
    return {
        "effects": [
            {"effect": e.identifier, "parameters": parameters(e), "onset": case.onset} for e in case.effects
        ],
        "class": collinear_class(case, [flights[file] for file in FILES[:-1]]),
        "true_model_residual": dict(zip(CHANNELS, residual.tolist(), strict=True)),
        "parameters_residual": dict(
            zip(CHANNELS, residual_of_true_parameters(case, held_out, residual).tolist(), strict=True)
        ),
        "best_onset": {
            f: best for f in FILES if (best := best_onset_of_flight(case, flights[f])) is not None
        },
        "visibility": visibility,
        "visibility_in_training": {f: residual_and_visibility(case, flights[f])[1] for f in FILES[:-1]},
        "visibility_of_each": visibility_of_each(case, held_out, residual),
        "simulator": simulator,
        "quality": case.quality.name,
        "kind": case.draw.kind,
        "seed": case.seed,
        "index": case.draw.index,
        "attempt": case.draw.attempt,
        "vehicle_off": {"mass": case.quality.mass_off, "thrust": case.quality.thrust_off},
        "plans": {file: plan.kind for file, plan in case.plans.items()},
        **(of_wild(case, flights) if case.quality.name == "wild" else {}),
    }


def of_wild(case: Case, flights: dict[str, FlightPair]) -> dict[str, Any]:
    """Return what the truth of a `wild` case holds besides."""
    return {"within_tolerance": within_tolerance(case, flights), "sensors": sensors(case)}


def sensors(case: Case) -> dict[str, Any]:
    """Return rate, input and noise of a case, by which the results of a `wild` set can be taken apart."""
    return {"input": case.input.kind, "semantics": case.input.semantics, **dc.asdict(case.quality)}


def flight_pair(case: Case, file: str, exact: FlightLog, noisy: FlightLog) -> FlightPair:
    """Return the pair of one flight; both begin where the measured one counts, and know when commands act."""
    known = [
        best_known(dc.replace(log, name=file), exact.u, case.vehicle, case.input.kind)
        for log in (noisy, exact)
    ]
    measured = make_flight_residuals(known[0], case.vehicle)
    return FlightPair(measured, make_flight_residuals(known[1], case.vehicle, since=float(measured.t[0])))


def equivalent_library_effects(case: Case, flights: dict[str, FlightPair]) -> list[str]:
    """Return library effects that explain, in all flights, what the out-of-library effect of a case leaves there.

    A ceiling effect, for example, is a mass error to a vehicle that stays where its lift is even. The remainder must be
    of a visibility below `NO_GAP`, were all of it in one channel.
    """
    measured, trace, noise, within = _left_by_all(case, flights)
    return effects_of_trace(measured, trace, noise, stated_tolerance(case, measured), Priors(), within)


def _left_by_all(
    case: Case, flights: dict[str, FlightPair]
) -> tuple[list[FlightResiduals], dict[str, np.ndarray], NoiseModel, float]:
    """Return the flights, what all effects leave there (m, 15), its noise, and the squared distance of no gap."""
    off = [Term(effect) for effect in case.quality.background(case.vehicle)]
    measured = [pair.measured for pair in flights.values()]
    trace = {pair.true.name: pair.true.y - _left(pair.true, off) for pair in flights.values()}
    noise = fit_noise([pair.errors for pair in flights.values()], measured[0].grid.step)
    return measured, trace, noise, (NO_GAP**2 - 1.0) * sum(len(y) for y in trace.values())


def parameters(effect: Effect) -> dict[str, Any]:
    """Return the parameters by name; the fields of an out-of-library effect."""
    return effect.values or dict(vars(effect))


def collinear_class(case: Case, training: list[FlightPair]) -> list[list[str]]:
    """Return per effect the names that are physically the same in the training flights, its own first.

    Whitened with what noise really left there, so that nothing is solved for it.
    """
    if not case.effects or case.draw.kind == "foreign":
        return [[effect.identifier] for effect in case.effects]
    flights, terms, noise = _as_fitted(case, training)
    tolerance, priors = stated_tolerance(case, flights), Priors()
    return [
        [effect.identifier, *collinear_effects(flights, terms, i, noise, tolerance, priors)]
        for i, effect in enumerate(case.effects)
    ]


def within_tolerance(case: Case, flights: dict[str, FlightPair]) -> list[bool]:
    """Return per effect whether it is the same, in all flights, as what vehicle file and input may be off by.

    Out-of-library effects are taken together.
    """
    if case.draw.kind == "foreign":
        measured, trace, noise, within = _left_by_all(case, flights)
        same = is_calibration_trace(measured, trace, noise, stated_tolerance(case, measured), within)
        return [same] * len(case.effects)
    measured, terms, noise = _as_fitted(case, list(flights.values()))
    tolerance = stated_tolerance(case, measured)
    return [is_calibration(measured, terms, i, noise, tolerance) for i in range(len(terms))]


def _as_fitted(
    case: Case, flights: Sequence[FlightPair]
) -> tuple[list[FlightResiduals], list[Term], NoiseModel]:
    """Return the flights as measured, the true terms, and the noise that the true model leaves."""
    measured = [pair.measured for pair in flights]
    noise = fit_noise([pair.errors for pair in flights], measured[0].grid.step)
    return measured, [Term(effect, dict(case.onset)) for effect in case.effects], noise


def stated_tolerance(case: Case, flights: Sequence[FlightResiduals]) -> Tolerance:
    """Return what vehicle file, input and sensors may be off by, as the files of a case state it.

    Of `wild` alone it holds what the vehicle file states, a throttle's scale and curve, and when commands act: the
    flights know all of these, but nobody else does.
    """
    tolerance = tolerance_of(flights)
    if case.quality.name != "wild":
        return tolerance
    told = [
        dc.replace(
            e,
            log=dc.replace(e.log, input=case.input.kind, timing=case.input.timing(e.log.step)),
            vehicle=dc.replace(e.vehicle, command_timing="held"),
        )
        for e in flights
    ]
    return with_input(Options.for_sensors(tolerance.real, tolerance), told).tolerance


def residual_and_visibility(case: Case, flight: FlightPair) -> tuple[np.ndarray, float]:
    """Return the RMS (15,) that the true model leaves, and visibility: the largest ratio of a channel's RMS to it.

    What the vehicle file is off by is no effect: it is taken out of the nominal residual.
    """
    noise = np.sqrt(np.mean(flight.errors**2, axis=0))
    off = [Term(effect) for effect in case.quality.background(case.vehicle)]
    total = np.sqrt(np.mean((flight.measured.y - _left(flight.true, off)) ** 2, axis=0))
    return noise, float(np.max(total / np.maximum(noise, 1e-12)))


def residual_of_true_parameters(case: Case, flight: FlightPair, noise: np.ndarray) -> np.ndarray:
    """Return the RMS (15,) that the true parameters leave: noise, and gusts, of which they give the strength alone."""
    if case.draw.kind == "foreign" or all(effect.predicted is effect for effect in case.effects):
        return noise
    known = [*case.quality.background(case.vehicle), *(e.predicted for e in case.effects)]
    left = flight.true.y - _left(flight.true, [Term(effect, dict(case.onset)) for effect in known])
    return np.sqrt(noise**2 + np.mean(left**2, axis=0))


def best_onset_of_flight(case: Case, flight: FlightPair) -> float | None:
    """Return `best_onset` of a flight [s]; None where nothing begins in it."""
    file = flight.true.name
    onset = case.onset[file]
    if onset is None or case.draw.kind == "foreign":
        return None
    terms = [Term(effect, dict(case.onset)) for effect in case.effects_of(file)]
    noise = fit_noise([flight.errors], flight.true.grid.step)
    return best_onset(flight.true, flight.errors, terms, onset, noise)


def visibility_of_each(case: Case, flight: FlightPair, noise: np.ndarray) -> list[float]:
    """Return for every effect alone the largest ratio of noise with its trace to noise; NaN out of the library."""
    evidence, effects = flight.true, case.effects_of(FILES[-1])
    if case.draw.kind == "foreign":
        return [float("nan")] * len(effects)
    terms = [Term(effect, dict(case.onset)) for effect in effects]
    out = []
    for i in range(len(terms)):
        trace = _left(evidence, terms) - _left(evidence, terms[:i] + terms[i + 1 :])
        out.append(float(np.max(np.sqrt(1 + np.mean(trace**2, axis=0) / np.maximum(noise, 1e-12) ** 2))))
    return out
