"""What the causes leave: noise, or something the library does not have.

Every test returns the probability that something material is there, and its power. residual: by
flight, (m, 15) what a model leaves.
"""

import dataclasses as dc
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import special

from np_drake.diagnosis.adequacy.linear_model import LinearModel
from np_drake.diagnosis.adequacy.residual_statistics import (
    SLOW,
    slow_torque,
    strongest_burst,
    strongest_line,
)
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import Materiality, Options
from np_drake.diagnosis.regressors import PREFIX
from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals, low_pass
from np_drake.diagnosis.residuals.position_error import squared_position_errors
from np_drake.diagnosis.residuals.residual_parts import CHANNELS
from np_drake.diagnosis.result import Finding
from np_drake.diagnosis.selection import Ranking
from np_drake.diagnosis.wind import gust_probability
from np_drake.files.number_text import measure

# Slope of a probability's logit in the logarithm of a ratio: no verdict depends on it; own choice.
STEEPNESS = 6.0
ALONG_PATH = "a force that goes with the path: with the place, or with the motion there"
OTHER_SPEED = "the same places at another speed"
SLOW_FORCE = Finding(
    "slow force",
    "a level force that comes and goes, of which no wind can be made",
    1.0,
    measurement=(
        "hover for 20 s each with two opposite headings: a tilt turns with the "
        "vehicle, air does not"
    ),
)


class Indication(NamedTuple):
    """Structure that the flights of a fit show.

    probability: that it is there and material [1].
    power: (6,) in the channels of the wrench [N², (N·m)²]. position: mean squared position error
        that it causes [m²].
    """

    probability: float
    finding: Finding
    power: np.ndarray
    position: float

    @classmethod
    def of(
        cls,
        probability: float,
        finding: Finding,
        flights: Sequence[FlightResiduals],
        wrench: Sequence[np.ndarray],
    ) -> "Indication":
        """Return the structure that is a wrench (m, 6) in each of the flights [N, N·m]."""
        moved = [
            squared_position_errors(e, w, np.ones(len(w), bool))
            for e, w in zip(flights, wrench, strict=True)
        ]
        power = np.mean(np.concatenate(wrench) ** 2, axis=0)
        return cls(probability, finding, power, float(np.mean(np.concatenate(moved))))


@dc.dataclass(frozen=True)
class Unexplained:
    """What the effects of the best model leave: every structure, and a slow level force, which may
    be that of gusts.
    """

    structures: tuple[Indication, ...]
    slow: Indication

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is more probable than not, a slow level force apart."""
        return tuple(s.finding for s in self.structures if s.probability > 0.5)


def find_unexplained(
    ranking: Ranking, linear: LinearModel, structure: Sequence[int], held: HeldOut
) -> Unexplained:
    """Return the generic structure beside the best model, and what the tests find in the residual
    of all flights.

    Args:
        structure: positions of the generic structure that describes the rest.
    """
    options, best, flights = ranking.options, ranking.best, ranking.problem.flights
    residual = {e.name: best.residual(e) for e in flights}
    swung = {e.name: held.swing_free_residual(e) for e in held.flights}
    hidden = any(t.has_hidden_state for t in best.terms)
    slowly = gust_probability(flights, residual, held.flights, swung, options, hidden=hidden)
    both = residual | swung
    slow = [_slow_part(e, residual, [0, 1]) for e in flights]
    said = [_indication(linear, structure, g, options) for g in structure]
    # A payload, whose swing may be lost, and gusts burst as well.
    said += (
        [] if hidden or slowly > 0.5 else [_burst_test([*flights, *held.flights], both, options)]
    )
    said.append(_line_test(flights, held.flights, both, options))
    said.append(_slow_torque_test(flights, held.flights, both, options, hidden=hidden))
    return Unexplained(tuple(said), Indication.of(slowly, SLOW_FORCE, flights, slow))


def _indication(
    linear: LinearModel, structure: Sequence[int], g: int, options: Options
) -> Indication:
    """Return structure g beside the best model and the rest of `structure`."""
    flights, candidate = linear.flights, linear.structure[g]
    rest = tuple(k for k in structure if k != g)
    there = float(special.expit(linear.evidence((), structure) - linear.evidence((), rest)))
    parts = [linear.part(structure, g, e)[:, WRENCH] for e in flights]
    part = np.concatenate(parts)
    force, torque = (
        float(np.sqrt(np.mean(np.sum(part[:, c] ** 2, axis=1)))) for c in (FORCE, TORQUE)
    )
    least_force, least_torque = _least_structure(flights, options.materiality)
    figures = {"force": force, "torque": torque, **candidate.figures}
    name = candidate.identifiers[0].removeprefix(PREFIX)
    finding = Finding(
        name, candidate.variant, force / flights[0].weight, figures, candidate.measurement
    )
    if name == "place" and options.tolerance.unmeasured:
        finding = dc.replace(finding, name="path", text=ALONG_PATH, measurement=OTHER_SPEED)
    material = force >= least_force or torque >= least_torque
    return Indication.of(there if material else 0.0, finding, flights, parts)


def _burst_test(
    flights: Sequence[FlightResiduals], residual: dict[str, np.ndarray], options: Options
) -> Indication:
    """Return a material burst, which neither noise nor sensors make."""
    burst = strongest_burst(flights, residual)
    axis, figures = CHANNELS[burst.axis], {"time": burst.time, "force": burst.size}
    text = (
        f"a {axis} that comes now and then, as in {burst.flight} at {burst.time:.1f} s, "
        f"{measure(burst.size, 'N')}"
    )
    large = burst.size > _least_structure(flights, options.materiality)[0]
    probability = _above(burst.prominence, options.thresholds.burst_ratio) if large else 0.0
    finding = Finding("burst", text, burst.prominence, figures, "the same trajectory twice more")
    return Indication.of(
        probability, finding, flights, [_slow_part(e, residual, [burst.axis]) for e in flights]
    )


def _line_test(
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    options: Options,
) -> Indication:
    """Return a material spectral line that held-out flights show as well."""
    thresholds, least = options.thresholds, _least_lines(flights, options.materiality)
    line = strongest_line(flights, residual, least)
    again = (
        strongest_line(held_out, residual).prominence
        > thresholds.held_out_share * thresholds.line_ratio
    )
    text = f"a line in {CHANNELS[line.channel]} at {line.frequency:.2f} Hz"
    figures = {"frequency": line.frequency, "rms": line.rms}
    large = line.rms >= least[line.channel]
    probability = _above(line.prominence, thresholds.line_ratio) if large and again else 0.0
    measurement = "hover at two thrusts with rotor speed logged: an imbalance turns with the rotors"
    finding = Finding("line", text, line.prominence, figures, measurement)
    channel = np.arange(6) == line.channel
    waves = [
        np.sqrt(2) * line.rms * np.sin(2 * np.pi * line.frequency * e.t)[:, None] * channel
        for e in flights
    ]
    return Indication.of(probability, finding, flights, waves)


def _slow_torque_test(
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    options: Options,
    *,
    hidden: bool,
) -> Indication:
    """Return a material slow torque that held-out flights show as well; hidden: whether a swing may
    have been lost.
    """
    thresholds, limit = options.thresholds, options.thresholds.slow_torque_ratio
    ratio, share, rms, axis = slow_torque(flights, residual)
    large = rms > _least_structure(flights, options.materiality)[1]
    large = large and (share > thresholds.held_out_share or not hidden)
    again = slow_torque(held_out, residual)[0] > thresholds.held_out_share * limit
    probability = _above(ratio, limit) if large and again else 0.0
    figures, measurement = {"ratio": ratio}, "hover for a minute with rotor speed logged"
    finding = Finding("slow torque", "a torque that comes and goes", ratio, figures, measurement)
    return Indication.of(
        probability, finding, flights, [_slow_part(e, residual, [3 + axis]) for e in flights]
    )


def _slow_part(
    e: FlightResiduals, residual: dict[str, np.ndarray], channels: Sequence[int]
) -> np.ndarray:
    """Return the slow part (m, 6) of some channels of a residual, without its mean."""
    slow = low_pass(residual[e.name][:, WRENCH], e.grid.step, SLOW)
    return (slow - slow.mean(axis=0)) * np.isin(np.arange(6), channels)


def _above(ratio: float, threshold: float) -> float:
    """Return the probability that a ratio is above what noise has: one half at the threshold."""
    return float(1 / (1 + (threshold / max(ratio, 1e-9)) ** STEEPNESS))


def _least_structure(
    flights: Sequence[FlightResiduals], materiality: Materiality
) -> tuple[float, float]:
    """Return the least RMS force [N] and torque [N·m] of material structure."""
    tau = np.concatenate([e.nominal[:, 3:] - e.nominal[:, 3:].mean(axis=0) for e in flights])
    commanded = float(np.sqrt(np.mean(np.sum(tau**2, axis=1))))
    return materiality.force * flights[0].weight, materiality.torque * commanded


def _least_lines(flights: Sequence[FlightResiduals], materiality: Materiality) -> np.ndarray:
    """Return (6,) the least RMS of a material line by channel of the wrench [N, N·m]."""
    y = np.concatenate([e.y[:, WRENCH] for e in flights])
    least = np.repeat(_least_structure(flights, materiality), 3)
    return np.maximum(np.sqrt(materiality.structure_share * np.mean(y**2, axis=0)), least)
