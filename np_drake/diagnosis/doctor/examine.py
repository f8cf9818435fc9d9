"""Examination of flight logs before a diagnosis: usable or not, and which effects they can tell.

An effect is told from some size on, beside nuisance and what it resembles. `LogReport.as_json` is
the content of `np-drake doctor --json`.
"""

import dataclasses as dc
import math
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from itertools import pairwise
from operator import add
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.diagnosis.calibration import nuisance_of, subtract_file_calibration
from np_drake.diagnosis.doctor.flight_facts import (
    FlightFacts,
    findings_on,
    flight_facts,
    law_findings,
    motion_of,
)
from np_drake.diagnosis.gap import excitation, excited, manoeuvre, tells_apart
from np_drake.diagnosis.options import Options, Priors
from np_drake.diagnosis.regressors import (
    DRAG,
    PAYLOAD,
    WIND,
    Candidate,
    hidden_from,
    library_candidates,
    options_of,
    wind_candidates,
)
from np_drake.diagnosis.residuals import (
    FORCE,
    LEAST_DURATION,
    FlightResiduals,
    common_step,
    find_outliers,
    make_flight_residuals,
    require_alike,
)
from np_drake.diagnosis.result import CHANNELS
from np_drake.diagnosis.selection.map_model import noise_of
from np_drake.diagnosis.selection.payload_search import payload_about, payload_of
from np_drake.effects.base import Effect, Parameter, correlation_root, usual_size
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.library import LIBRARY, REQUIREMENTS, effect_of, effects_for
from np_drake.estimation.noise import NoiseModel, scale_only
from np_drake.estimation.regression import Gram
from np_drake.files.file_access import plain
from np_drake.files.number_text import number
from np_drake.finding import Finding, Kind, Place, joined, shown_at
from np_drake.flight_log import FlightLog
from np_drake.logs.inputs import with_hover_thrust
from np_drake.vehicle import Vehicle

# of tethers at which an examination asks for a payload [m]; own choice
TRACE_LENGTHS = np.geomspace(0.3, 1.5, 5)
LEAST_DRAG = 2.0  # posterior deviations from which a drag is taken as that of the vehicle [1]


@dc.dataclass(frozen=True)
class Trace:
    """Columns (m, 15, k) by flight of one variant of an effect, for parameters at their usual size.

    parameters: of the first columns; further columns are free beside them and not asked for.
    typical: usual size of each.
    size: for an effect that is not linear, the size at which its trace is predicted, in the
        parameter's unit; None: it is linear.
    """

    identifier: str
    parameters: tuple[Parameter, ...]
    typical: tuple[float, ...]
    columns: dict[str, np.ndarray]
    size: float | None = None

    @property
    def width(self) -> int:
        """Number of columns."""
        return next(iter(self.columns.values())).shape[-1]


def traces(flights: Sequence[FlightResiduals], priors: Priors) -> list[Trace]:
    """Return the traces of all variants of all effects that such logs can show; payloads at
    `TRACE_LENGTHS`, a steady wind through the usual drag of such a vehicle.

    Gusts have none: they are a noise.
    """
    plain = library_candidates(flights)
    every_trace = [_of_candidate(c, flights) for c in plain]
    wind = LIBRARY[WIND].parameters
    for c in wind_candidates(flights, plain)[:1]:
        columns = {n: X[..., 3:] for n, X in c.columns.items()}
        every_trace.append(Trace(WIND, wind, tuple(p.typical for p in wind), columns))
    shows_payload = PAYLOAD in LIBRARY and PAYLOAD not in hidden_from(flights)
    for length in TRACE_LENGTHS if shows_payload else ():
        payload = payload_about(flights, payload_of(length), priors, shaped=False)
        mass = LIBRARY[PAYLOAD].parameters[:1]
        columns = payload.candidate(flights).columns
        usual = usual_size(mass[0], flights[0].vehicle)
        for X in columns.values():
            X[..., 0] *= usual / payload.guess.effect.values["mass"]
        every_trace.append(Trace(PAYLOAD, mass, (usual,), columns))
    return every_trace


def _of_candidate(c: Candidate, flights: Sequence[FlightResiduals]) -> Trace:
    (identifier,) = c.identifiers
    effect = effect_of(identifier)
    free = tuple(p for p in effect.parameters if not p.choices)
    vehicle = flights[0].vehicle
    usual = tuple(usual_size(p, vehicle) for p in free)
    if effect.linear or len(free) < len(effect.parameters) or not effect.grid(vehicle):
        alone = np.linalg.inv(correlation_root(effect))  # each parameter by itself
        return Trace(identifier, free, usual, {n: X @ alone for n, X in c.columns.items()})
    values = next(iter(c.terms(np.array([0.5])))).effect.values
    size = values[free[0].name] - free[0].neutral
    # At that size; a coefficient of one half stands for it.
    half = {n: 0.5 * X for n, X in c.columns.items()}
    return Trace(identifier, free[:1], (usual[0],), half, size)


def nearest_usual(variants: Sequence[Trace]) -> list[Trace]:
    """Return one trace of each effect: of those that are not linear, the one nearest its usual
    size.
    """

    def away(trace: Trace) -> float:
        return 0.0 if trace.size is None else abs(math.log(abs(trace.size) / trace.typical[0]))

    names = dict.fromkeys(trace.identifier for trace in variants)
    return [min((t for t in variants if t.identifier == name), key=away) for name in names]


def explain(
    flights: Sequence[FlightResiduals],
    nuisance: Sequence[Candidate],
    traces: Sequence[Trace],
    options: Options,
) -> tuple[list[FlightResiduals], NoiseModel, float | None]:
    """Fit all traces and the nuisance together, and return the flights with their outliers known,
    what is left as noise, and the mean lateral drag [N·s/m]; None where that is not told from zero.

    An effect that is in the logs does not count as noise; what no effect explains does.

    Args:
        nuisance: nuisance columns, with prior N(0, 1).
        options: tolerances of sensors, and the share of a linear prediction that is wrong.
    """
    step = flights[0].grid.step
    _, residual = _fitted(
        flights, nuisance, traces, scale_only([flight.y for flight in flights], step)
    )
    flights = [
        dc.replace(flight, outliers=flight.outliers | find_outliers(r, step))
        for flight, r in zip(flights, residual, strict=True)
    ]
    channels = [flight.bridged(flight.y) for flight in flights]
    noise = scale_only(channels, step)
    drag = None
    for _ in range(2):
        drag, residual = _fitted(flights, nuisance, traces, noise)
        noise = noise_of(flights, residual, channels, options, options.priors.linear_error)
    return flights, noise, drag


def _fitted(
    flights: Sequence[FlightResiduals],
    nuisance: Sequence[Candidate],
    traces: Sequence[Trace],
    noise: NoiseModel,
) -> tuple[float | None, list[np.ndarray]]:
    """Return the mean lateral drag [N·s/m], None where it is not told from zero, and by flight the
    residual (m, 15) without outliers.
    """
    blocks = [c.columns for c in nuisance] + [t.columns for t in traces]
    total = reduce(
        add, (flight.gram(noise, [b[flight.name] for b in blocks]) for flight in flights)
    )
    mean, covariance = total.posterior(np.arange(len(total.Xy)))
    columns = (np.concatenate([b[flight.name] for b in blocks], axis=-1) for flight in flights)
    residual = [
        flight.bridged(flight.y - X @ mean) for flight, X in zip(flights, columns, strict=True)
    ]
    at = sum(c.size for c in nuisance)
    drag = None
    for trace in traces:
        if trace.identifier == DRAG:
            drag = _drag(trace, mean[at : at + 2], np.diag(covariance)[at : at + 2])
        at += trace.width
    return drag, residual


def _drag(trace: Trace, mean: np.ndarray, variance: np.ndarray) -> float | None:
    """Return the mean of lateral drags (2,) by their precision; None where it is not told."""
    weight = 1.0 / variance
    size = float(weight @ mean / weight.sum())
    return size * trace.typical[0] if size > LEAST_DRAG * weight.sum() ** -0.5 else None


DEVIATIONS = 3.0  # 99.7 %
# factor by which another effect must widen the smallest size to be named [1]; own choice
RESEMBLES = 2.0
MOST_RIVALS = 3  # effects that are named and modelled beside one [1]; own choice
# share of a trace outside another's, below which it is a case of that [1]; own choice
NESTED = 1e-3
SINGULAR = 1e-9  # share of the largest information below which there is none [1]


@dc.dataclass(frozen=True)
class Smallest:
    """Smallest sizes (k,) of the parameters of an effect, in their units: alone, and
    `adjacent` to those it resembles.
    """

    identifier: str
    parameters: tuple[str, ...]
    alone: np.ndarray
    adjacent: np.ndarray
    resembles: tuple[str, ...]


class Information:
    """Whitened inner products of traces, less what nuisance parameters explain.

    Args:
        nuisance: nuisance columns, with prior N(0, 1).
    """

    def __init__(
        self,
        flights: Sequence[FlightResiduals],
        noise: NoiseModel,
        nuisance: Sequence[Candidate],
        traces: Sequence[Trace],
    ):
        self.traces = list(traces)
        blocks = [c.columns for c in nuisance] + [t.columns for t in traces]
        total = reduce(
            add, (flight.gram(noise, [b[flight.name] for b in blocks]) for flight in flights)
        )
        self._gram = total.given(sum(c.size for c in nuisance))
        spans = pairwise(np.cumsum([0] + [t.width for t in traces]).tolist())
        self._at = {id(t): np.arange(*span) for t, span in zip(self.traces, spans, strict=True)}

    def deviations(self, trace: Trace, rivals: Sequence[Trace] = ()) -> np.ndarray:
        """Return the deviation (k,) of a trace's coefficients over their usual size, beside rivals
        with their prior.

        Further columns of the trace itself have that prior too.
        """
        asked, further = np.split(self._at[id(trace)], [len(trace.parameters)])
        index = np.concatenate([further, *(self._at[id(t)] for t in rivals), asked])
        chosen = Gram(self._gram.XX[np.ix_(index, index)], self._gram.Xy[index])
        scale = np.sqrt(np.maximum(self._gram.XX[asked, asked], 1e-12))
        unit = chosen.given(len(index) - len(asked)).XX / np.outer(scale, scale)
        values, vectors = np.linalg.eigh(0.5 * (unit + unit.T))
        return np.sqrt((vectors**2) @ (1 / np.maximum(values, SINGULAR))) / scale

    def inside(self, trace: Trace, other: Trace) -> bool:
        """Return whether a trace is that of an effect with more parameters, of which it is the
        simpler case.
        """
        a = self._at[id(trace)]
        b = self._at[id(other)]
        of_trace, cross, theirs = (self._gram.XX[np.ix_(i, j)] for i, j in ((a, a), (a, b), (b, b)))
        # Of a flight in which the other leaves nothing, it is no case of that.
        if len(other.parameters) <= len(trace.parameters) or not np.trace(theirs) > 0:
            return False
        ridge = SINGULAR * np.trace(theirs) * np.eye(len(b))
        outside = np.diag(of_trace - cross @ np.linalg.solve(theirs + ridge, cross.T))
        return bool(np.all(outside < NESTED * np.diag(of_trace)))


def smallest_sizes(information: Information) -> list[Smallest]:
    """Return the smallest sizes of all effects; of several variants, those of the variant that
    shows least.
    """
    known = nearest_usual(information.traces)
    sizes = []
    for main in known:
        variants = [t for t in information.traces if t.identifier == main.identifier]
        alone = _sizes(information, variants, ())
        near = _sizes(information, [main], ())
        wider = []
        for other in known:
            if other is not main and not information.inside(main, other):
                ratio = np.max(_sizes(information, [main], [other]) / near)
                wider += [(ratio, other)] if ratio > RESEMBLES else []
        most = [t for _, t in sorted(wider, key=lambda pair: -pair[0])[:MOST_RIVALS]]
        adjacent = np.maximum(alone, _sizes(information, variants, most))
        names = tuple(p.name for p in main.parameters)
        sizes.append(
            Smallest(main.identifier, names, alone, adjacent, tuple(t.identifier for t in most))
        )
    return sizes


def _sizes(
    information: Information, variants: Sequence[Trace], rivals: Sequence[Trace]
) -> np.ndarray:
    """Return the smallest size (k,) of each parameter."""
    linear = [t for t in variants if t.size is None]
    if linear:
        sizes = [information.deviations(t, rivals) * np.array(t.typical) for t in linear]
        return np.max(DEVIATIONS * np.array(sizes), axis=0)
    largest = 0.0
    for sign in (1, -1):
        at = {sign * t.size: t for t in variants if t.size is not None and sign * t.size > 0}
        if at:
            deviations = [information.deviations(at[size], rivals)[0] for size in sorted(at)]
            lengths = 1 / np.maximum(deviations, 1e-12)
            largest = max(largest, _crossing(np.array(sorted(at)), lengths))
    return np.array([largest])


def _crossing(size: np.ndarray, length: np.ndarray) -> float:
    """Return the size at which a trace is `DEVIATIONS` long, given its length at some sizes: a
    power of the size.
    """
    x = np.log(size)
    y = np.log(np.maximum(length, 1e-9) / DEVIATIONS)
    if len(x) == 1:
        return float(size[0] * math.exp(-y[0]))
    above = np.flatnonzero(y >= 0)
    k = max(1, int(above[0])) if len(above) else len(x) - 1
    slope = (y[k] - y[k - 1]) / (x[k] - x[k - 1])
    return float(math.exp(x[k] - y[k] / max(slope, 0.3)))


GUST_TIME = 1.0  # correlation time of the gusts that the doctor looks for [s]


def smallest_gust(noise: NoiseModel, seconds: float) -> float:
    """Return the least deviation of a lateral force of gusts that is told from the noise [N].

    The log likelihood of a spectrum is a sum over independent frequencies (Whittle), and so is the
    information on the power of a first-order process.

    Args:
        seconds: length of all flights [s].
    """
    frequency = np.arange(1, max(2, int(0.4 / noise.step * seconds))) / seconds
    # one-sided, of unit variance [1/Hz]
    gust = 4 * GUST_TIME / (1 + (2 * np.pi * frequency * GUST_TIME) ** 2)
    information = sum(
        np.sum((gust / power) ** 2) for power in noise.spectrum(frequency)[:2] if power[0] > 0
    )
    return math.sqrt(DEVIATIONS / math.sqrt(information)) if information > 0 else math.inf


YES = "yes"
NO = "no"
NEVER = "never"


@dc.dataclass(frozen=True)
class Answer:
    """Whether a log can tell one parameter of an effect.

    smallest: size that is told from zero at 99.7 % (three posterior deviations), beside nuisance
    parameters and the effects named in `beside`; infinite: none. alone: the same beside nuisance
    parameters only.
    typical: usual size for a vehicle of this mass and arm.
    verdict: `yes` (smallest is at most typical), `no`, or `never` (a log of this kind has no trace
        of it).
    todo: what to log or fly instead; empty for `yes`.
    note: through which drag a wind is told, in a few words.
    """

    identifier: str
    parameter: str
    unit: str
    smallest: float
    alone: float
    typical: float
    verdict: str = YES
    reason: str = ""
    todo: str = ""
    beside: tuple[str, ...] = ()
    note: str = ""

    @property
    def is_alike(self) -> bool:
        """Whether the size would be told but for the effects that it resembles."""
        return self.verdict != NEVER and not self.alone > self.typical


@dc.dataclass(frozen=True)
class LogReport:
    """Result of `examine`.

    usable: whether anything can be diagnosed; problems: what stands against it, or limits it.
    excitation: RMS values and spans over all flights, largest speed and lowest height; with the
        vehicle's where one is given.
    residual_force: by axis of B, RMS of the residual force over weight, nothing fitted [1]; empty
        without a vehicle.
    noise_floor: by channel, RMS of what no effect explains [N, N·m]; empty without a vehicle.
    """

    flights: tuple[FlightFacts, ...]
    usable: bool
    problems: tuple[Finding, ...]
    vehicle: str = ""
    sensors: str = ""
    excitation: dict[str, float] = dc.field(default_factory=dict)
    noise_floor: dict[str, float] = dc.field(default_factory=dict)
    answers: tuple[Answer, ...] = ()
    residual_force: dict[str, float] = dc.field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return the report in plain types; values that are not finite become None."""
        return plain({**dc.asdict(self), "problems": [str(problem) for problem in self.problems]})


MOST_SECONDS = 120.0  # of a flight from which effects are answered for [s]; own choice: memory
MOST_GAPS = 0.1  # share of rows put into gaps from which a log is limited [1]; own choice
# share of rows with a rotor at a limit from which a log is limited [1]; own choice
MOST_SATURATED = 0.05
FAR = 100.0  # usual sizes beyond which a smallest size is infinite [1]
INSTEAD = {  # what to log where a log does not tell a key of `library.REQUIREMENTS`
    "commands": "log the commanded thrust and torque as well",
    "thrust": "log rotor speed, with a thrust coefficient from a stand",
    "torque": "log the torque command, rotor speed, or every motor's throttle",
    "accelerations": "log the acceleration",
    "height": "log the position",
    "velocity": "log the velocity",
    "attitude": "log the attitude",
}


def examine(
    logs: Sequence[FlightLog],
    vehicle: Vehicle | None = None,
    *,
    sheets: Mapping[str, Mapping[str, Any]] | None = None,
    on_progress: Callable[[float, str], None] | None = None,
) -> LogReport:
    """Examine flight logs of one kind together.

    Args:
        logs: flights, with thrust and torque from the vehicle where their input is rotor speed or
            throttle.
        vehicle: the nominal vehicle; None: facts, motion and conventions alone, and no effects.
        sheets: by flight, what its import did; sensors of imported flights are taken as real.
        on_progress: called with the share done [1] and the name of the step.
    Raises: ValueError: if there is no flight, or flights have different inputs.
    """
    require(logs, "doctor: logs must hold at least one flight; got none.")
    require_alike("doctor", logs)
    require(
        len({log.a is None for log in logs}) == 1,
        "doctor: either all flights have accelerations or none. Examine them one kind at a time.",
    )
    if vehicle is not None:
        vehicle, logs, _ = with_hover_thrust(vehicle, logs)
    tell = on_progress or (lambda share, text: None)
    tell(0.0, "signals and clocks")
    facts = tuple(
        dc.replace(flight_facts(log, vehicle), imported=dict((sheets or {}).get(log.name, {})))
        for log in logs
    )
    motion = motion_of(logs)
    findings = [finding for log in logs for finding in law_findings(log)]
    wrong = joined(shown_at(findings, Place.FAILURE))
    problems = list(wrong)
    for log, f in zip(logs, facts, strict=True):
        problems += [finding.of(log.name) for finding in shown_at(log.findings, Place.LIMIT)]
        if f.bridged > MOST_GAPS * f.rows:
            text = f"{f.bridged / f.rows:.0%} of the rows were put into gaps"
            problems.append(Finding(Kind.LIMITED, f.name, text))
        if f.saturated is not None and f.saturated > MOST_SATURATED:
            text = f"a rotor is at its limit in {f.saturated:.0%} of the rows"
            problems.append(Finding(Kind.LIMITED, f.name, text))
    long_enough = [log for log in logs if log.t[-1] - log.t[0] >= LEAST_DURATION]
    if not long_enough:
        where = f"no flight lasts {LEAST_DURATION:g} s"
        problems.append(Finding(Kind.LIMITED, where, "fly longer"))
    if vehicle is None or not long_enough or wrong:
        if vehicle is None:
            text = "effects are not judged (np-drake doctor --vehicle FILE)"
            problems.append(Finding(Kind.LIMITED, "no vehicle file", text))
        problems += joined(shown_at(findings, Place.ANSWER))
        fastest = {
            key: max(f.motion[key] for f in facts)
            for key in ("speed [m/s]", "rate [rad/s]", "tilt [deg]")
        }
        still = nothing_moves(fastest | {"thrust variation [1]": 0.0}, logs)
        usable = bool(long_enough) and not (wrong or still)
        return LogReport(facts, usable, (*still, *problems), excitation=motion)
    report = LogReport(facts, True, tuple(problems), vehicle.name, excitation=motion)
    return _with_answers(report, long_enough, vehicle, tell)


def _with_answers(
    report: LogReport,
    logs: Sequence[FlightLog],
    vehicle: Vehicle,
    tell: Callable[[float, str], None],
) -> LogReport:
    """Return the report with excitation and answers, from the first `MOST_SECONDS` of flights."""
    tell(0.2, "residuals")
    logs = [log.rows(0, int((log.t <= log.t[0] + MOST_SECONDS).sum())) for log in logs]
    step = common_step([log.t for log in logs], len(logs))
    flights = [subtract_file_calibration(make_flight_residuals(log, vehicle, step)) for log in logs]
    findings = [finding for flight in flights for finding in findings_on(flight)]
    moving = excitation(flights)
    options = options_of(flights, real=True if any(f.imported for f in report.flights) else None)
    nuisance = nuisance_of(flights, options.tolerance, options.priors)
    all_traces = traces(flights, options.priors)
    # All that the flights may hold, payloads on every tether, is no noise.
    near = [t for t in nearest_usual(all_traces) if t.identifier != PAYLOAD]
    tell(0.6, "noise")
    cleared, noise, drag = explain(
        flights, nuisance, [*near, *(t for t in all_traces if t.identifier == PAYLOAD)], options
    )
    tell(0.8, "smallest sizes")
    information = Information(cleared, noise, nuisance, all_traces)
    gust = smallest_gust(noise, moving["duration [s]"])
    still = nothing_moves(moving, logs)
    y = np.concatenate([flight.y[~flight.outliers, FORCE] for flight in flights])
    force = np.sqrt(np.mean(y**2, axis=0)) / flights[0].weight
    return dc.replace(
        report,
        usable=not still and not shown_at(findings, Place.FAILURE),
        problems=(*joined(findings), *report.problems, *still),
        sensors="real" if options.tolerance.real else "ideal",
        excitation=report.excitation | moving,
        residual_force=dict(zip("xyz", force.tolist(), strict=True)),
        noise_floor=dict(zip(CHANNELS, noise.rms.tolist(), strict=False)),
        answers=answers(smallest_sizes(information), gust, drag, flights),
    )


def nothing_moves(moving: dict[str, float], logs: Sequence[FlightLog]) -> tuple[Finding, ...]:
    """Return that flights do not move, and what to fly; empty where they do."""
    if excited(moving):
        return ()
    speed = number(moving["speed [m/s]"], 2)
    rate = number(moving["rate [rad/s]"], 2)
    logged = "" if any("velocity" in log.lacks for log in logs) else f"speed {speed} m/s, "
    text = (
        "fly sprints in both horizontal directions, climbs, and turns about every axis, for a "
        "minute"
    )
    return (Finding(Kind.LIMITED, f"nothing moves ({logged}rates {rate} rad/s)", text),)


def answers(
    sizes: Sequence[Smallest], gust: float, drag: float | None, flights: Sequence[FlightResiduals]
) -> tuple[Answer, ...]:
    """Return an answer for each parameter of each effect, in the order of the library.

    sizes: smallest sizes; those of the wind are for the usual drag of such a vehicle.
    gust: least deviation of the force of gusts [N]. drag: that of the vehicle, where it is known
    [N·s/m]: winds act through it.
    """
    hidden = hidden_from(flights)
    by_effect = {size.identifier: size for size in sizes}
    vehicle = flights[0].vehicle
    usual_drag = usual_size(LIBRARY[DRAG].parameters[0], vehicle)
    out: list[Answer] = []
    for name, effect in effects_for(flights[0].log.input).items():
        if name in hidden:
            out.append(_never(effect, hidden[name], vehicle))
        elif name == GustyWind.identifier:
            p = next(p for p in effect.parameters if p.name == "deviation")
            size = gust / (drag or usual_drag)
            out.append(_through_drag(Answer(name, p.name, p.unit, size, size, p.typical), drag))
        elif name in by_effect:
            is_wind = name == WIND
            scale = usual_drag / drag if is_wind and drag else 1.0
            each = _of_sizes(by_effect[name], scale, vehicle)
            out += [_through_drag(answer, drag) for answer in each] if is_wind else each
    return tuple(out)


def _never(effect: type[Effect], lacking: str, vehicle: Vehicle) -> Answer:
    """Return the answer on an effect of which a log that lacks this has no trace."""
    p = next(p for p in effect.parameters if not p.choices)
    usual = usual_size(p, vehicle)
    todo = INSTEAD.get(lacking) or manoeuvre((effect.identifier,))
    reason = REQUIREMENTS[lacking]
    sizes = (math.inf, math.inf, usual)
    return Answer(effect.identifier, p.name, p.unit, *sizes, NEVER, reason, todo)


def _through_drag(answer: Answer, drag: float | None) -> Answer:
    """Return the answer on a wind, which acts through the drag of the vehicle."""
    note = "with their drag" if drag else "with usual drag"
    reason = note if drag else f"{note}: these flights tell none"
    if answer.smallest > answer.typical and not answer.todo:
        answer = dc.replace(answer, verdict=NO, todo=manoeuvre((answer.identifier,)))
    return dc.replace(answer, reason=answer.reason or reason, note=note)


def _of_sizes(sizes: Smallest, scale: float, vehicle: Vehicle) -> list[Answer]:
    """Return the answers on the parameters of an effect.

    Args:
        scale: factor on the sizes [1].
        vehicle: for which a size is usual.
    """
    parameters = {p.name: p for p in effect_of(sizes.identifier).parameters}
    out = []
    for name, size_alone, size in zip(sizes.parameters, sizes.alone, sizes.adjacent, strict=True):
        p = parameters[name]
        usual = usual_size(p, vehicle)
        alone = float(size_alone * scale)
        smallest = float(size * scale)
        shown, shown_alone = (v if v <= FAR * usual else math.inf for v in (smallest, alone))
        answer = Answer(
            sizes.identifier, name, p.unit, shown, shown_alone, usual, beside=sizes.resembles
        )
        if not smallest <= usual:
            reason = "at its usual size it leaves no clear trace in these flights"
            todo = manoeuvre((sizes.identifier,))
            if answer.is_alike:
                reason = f"it cannot be told from {', '.join(sizes.resembles)} in these flights"
                todo = tells_apart(sizes.identifier, sizes.resembles[0]) or todo
            answer = dc.replace(answer, verdict=NO, reason=reason, todo=todo)
        out.append(answer)
    return out
