"""What the causes leave: noise, or something the library does not have."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from scipy import special

from np_drake.diagnosis.adequacy.linear_model import LinearModel
from np_drake.diagnosis.adequacy.residual_statistics import Line, slow_torque, strongest_burst, strongest_line
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import Materiality, Options
from np_drake.diagnosis.regressors import PREFIX
from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals
from np_drake.diagnosis.result import CHANNELS, Finding
from np_drake.diagnosis.selection import Ranking
from np_drake.diagnosis.wind import gust_probability
from np_drake.files.number_text import measure

# Slope of a probability's logit in the logarithm of a ratio: no verdict depends on it; own choice.
STEEPNESS = 6.0
ALONG_PATH = "a force that goes with the path: with the place, or with the motion there"
OTHER_SPEED = "the same places at another speed"
Indication = tuple[float, Finding]  # probability of a structure, and what it is


@dc.dataclass(frozen=True)
class Unexplained:
    """What the effects of the best model leave.

    probability: that something material is left, a slow level force apart [1].   findings: where it lives.
    slow_probability: of a slow level force [1].
    """

    probability: float
    findings: tuple[Finding, ...]
    slow_probability: float


def find_unexplained(ranking: Ranking, linear: LinearModel, structure: Sequence[int], held: HeldOut) -> Unexplained:
    """Return the generic structure beside the best model, and what the tests find in the residual of all flights.

    Args:
        ranking: of the models.
        linear: the best model, linear about its fit.
        structure: positions of the generic structure that describes the rest.
        held: the best fit on held-out flights.
    """
    options, best, flights = ranking.options, ranking.best, ranking.problem.flights
    held_out = held.flights
    residual = {e.name: best.residual(e) for e in flights}
    swung = {e.name: held.swing_free_residual(e) for e in held_out}
    hidden = any(t.has_hidden_state for t in best.terms)
    slowly = gust_probability(flights, residual, held_out, swung, options, hidden=hidden)
    said: list[Indication] = [indication(linear, structure, g, options) for g in structure]
    if not (hidden or slowly > 0.5):
        said.append(burst_test([*flights, *held_out], residual | swung, options))
    line = strongest_line(flights, residual, least_lines(flights, options.materiality))
    said.append(line_test(line, flights, held_out, swung, options))
    torque = slow_torque(flights, residual)
    said.append(slow_torque_test(torque, flights, held_out, swung, options, hidden=hidden))
    probability = max((p for p, _ in said), default=0.0)
    return Unexplained(probability, tuple(f for p, f in said if p > 0.5), slowly)


def indication(linear: LinearModel, structure: Sequence[int], g: int, options: Options) -> Indication:
    """Return structure g beside the best model as a finding, with the probability that it is there and material.

    Args:
        linear: the best model, linear about its fit.
        structure: positions of the generic structure beside the effects.
        g: position of the structure.
        options: bounds of what matters; of a vehicle that nobody measured a place is not told from the motion there.
    """
    flights, candidate = linear.flights, linear.structure[g]
    rest = tuple(k for k in structure if k != g)
    there = float(special.expit(linear.evidence((), structure) - linear.evidence((), rest)))
    part = np.concatenate([linear.part(structure, g, e) for e in flights])
    force, torque = (float(np.sqrt(np.mean(np.sum(part[:, c] ** 2, axis=1)))) for c in (FORCE, TORQUE))
    least_force, least_torque = least_structure(flights, options.materiality)
    figures = {"force": force, "torque": torque, **candidate.figures}
    name = candidate.identifiers[0].removeprefix(PREFIX)
    weight = flights[0].weight
    finding = Finding(name, candidate.variant, force / weight, figures, candidate.measurement)
    if name == "place" and options.tolerance.unmeasured:
        finding = dc.replace(finding, name="path", text=ALONG_PATH, measurement=OTHER_SPEED)
    return there if force >= least_force or torque >= least_torque else 0.0, finding


def burst_test(flights: Sequence[FlightResiduals], residual: dict[str, np.ndarray], options: Options) -> Indication:
    """Return the probability of a material burst, which neither noise nor sensors make.

    A payload, whose swing may be lost, and gusts do the like: beside these it is not asked.

    Args:
        flights: the flights.
        residual: by flight, (m, 15) what a model leaves of it.
        options: all that steers the answer.
    """
    burst, limit = strongest_burst(flights, residual), options.thresholds.burst_ratio
    axis, figures = CHANNELS[burst.axis], {"time": burst.time, "force": burst.size}
    text = f"a {axis} that comes now and then, as in {burst.flight} at {burst.time:.1f} s, {measure(burst.size, 'N')}"
    large = burst.size > least_structure(flights, options.materiality)[0]
    probability = _above(burst.prominence, limit) if large else 0.0
    return probability, Finding("burst", text, burst.prominence, figures, "the same trajectory twice more")


def line_test(
    line: Line,
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    options: Options,
) -> Indication:
    """Return the probability of a material spectral line that held-out flights show as well.

    Args:
        line: the strongest of the training flights.
        flights: training flights.
        held_out: held-out flights.
        residual: by held-out flight, (m, 15) what the model leaves of it.
        options: all that steers the answer.
    """
    thresholds = options.thresholds
    loud = line.rms >= least_lines(flights, options.materiality)[line.channel]
    again = strongest_line(held_out, residual).prominence > thresholds.held_out_share * thresholds.line_ratio
    text = f"a line in {CHANNELS[line.channel]} at {line.frequency:.2f} Hz"
    figures = {"frequency": line.frequency, "rms": line.rms}
    probability = _above(line.prominence, thresholds.line_ratio) if loud and again else 0.0
    measurement = "hover at two thrusts with rotor speed logged: an imbalance turns with the rotors"
    return probability, Finding("line", text, line.prominence, figures, measurement)


def slow_torque_test(
    torque: tuple[float, float, float],
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    options: Options,
    *,
    hidden: bool,
) -> Indication:
    """Return the probability of a material slow torque that held-out flights show as well.

    Args:
        torque: `slow_torque` of the training flights.
        flights: training flights.
        held_out: held-out flights.
        residual: by held-out flight, (m, 15) what the model leaves of it.
        options: all that steers the answer.
        hidden: whether a swing may have been lost.
    """
    ratio, share, rms = torque
    thresholds, limit = options.thresholds, options.thresholds.slow_torque_ratio
    large = rms > least_structure(flights, options.materiality)[1]
    large = large and (share > thresholds.held_out_share or not hidden)
    again = slow_torque(held_out, residual)[0] > thresholds.held_out_share * limit
    probability = _above(ratio, limit) if large and again else 0.0
    figures, measurement = {"ratio": ratio}, "hover for a minute with rotor speed logged"
    return probability, Finding("slow torque", "a torque that comes and goes", ratio, figures, measurement)


def _above(ratio: float, threshold: float) -> float:
    """Probability that a ratio is above what noise has: one half at the threshold."""
    return float(1 / (1 + (threshold / max(ratio, 1e-9)) ** STEEPNESS))


def least_structure(flights: Sequence[FlightResiduals], materiality: Materiality) -> tuple[float, float]:
    """Return the least RMS force [N] and torque [N·m] of material structure.

    Args:
        flights: the flights.
        materiality: bounds of what matters.
    """
    tau = np.concatenate([e.nominal[:, 3:] - e.nominal[:, 3:].mean(axis=0) for e in flights])
    weight = flights[0].weight
    commanded = float(np.sqrt(np.mean(np.sum(tau**2, axis=1))))
    return materiality.force * weight, materiality.torque * commanded


def least_lines(flights: Sequence[FlightResiduals], materiality: Materiality) -> np.ndarray:
    """Return (6,) the least RMS of a material line by channel of the wrench [N, N·m].

    Args:
        flights: the flights.
        materiality: bounds of what matters.
    """
    y = np.concatenate([e.y[:, WRENCH] for e in flights])
    least = np.repeat(least_structure(flights, materiality), 3)
    return np.maximum(np.sqrt(materiality.structure_share * np.mean(y**2, axis=0)), least)
