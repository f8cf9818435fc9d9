"""Tests of the residual for what neither noise nor sensors do, each with its probability."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.adequacy.residual_statistics import (
    Line,
    lift_apart,
    slow_torque,
    strongest_burst,
    strongest_line,
)
from np_drake.diagnosis.materiality import Materiality
from np_drake.diagnosis.options import Options, Thresholds
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.residuals import flight_residuals as ev
from np_drake.diagnosis.result import CHANNELS, Finding
from np_drake.diagnosis.wind import slow_power

UNSEEN = "unseen flights"  # name of what they alone show

Indication = tuple[float, Finding]  # what there may be, and how probable that is


def irregularities(
    flights: Sequence[FlightResiduals], residual: dict[str, np.ndarray], options: Options
) -> list[Indication]:
    """Return bursts and differing lift, which neither noise nor sensors make, each with its probability.

    A payload, whose swing may be lost, and gusts do the like: beside these it is not asked.
    """
    thresholds = options.thresholds
    least = (
        2 * least_structure(flights, options.materiality)[0]
    )  # no part of an effect, for which a half is enough
    burst, lift = strongest_burst(flights, residual), lift_apart(flights, residual)
    apart = lift / (flights[0].vehicle.mass * options.tolerance.acceleration)
    axis, figures = CHANNELS[burst.axis], {"time": burst.time, "force": burst.size}
    now = f"a {axis} that comes now and then, as in {burst.flight} at {burst.time:.1f} s, {burst.size:.2g} N"
    other = f"a mean lift that differs from flight to flight, {lift:.2g} N"
    bursts = _above(burst.prominence, thresholds.burst, thresholds) if burst.size > least else 0.0
    differs = _above(apart, thresholds.lift, thresholds) if lift > least else 0.0
    return [
        (bursts, Finding("burst", now, burst.prominence, figures)),
        (differs, Finding("lift", other, apart, {"force": lift})),
    ]


def novel_on_held_out(
    held_out: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    options: Options,
    usual: float,
) -> Indication:
    """Return what held-out flights show that training flights do not excite, with its probability.

    A slow force or torque on them is several times what sensors have, and the causes leave much of it.
    usual: slow power that is left of the flights of the fit [N²].
    """
    thresholds = options.thresholds
    torque, share, _ = slow_torque(held_out, residual)
    much = thresholds.held_out_power
    limit = thresholds.novel * thresholds.slow_torque
    probability = _above(torque, limit, thresholds) if share > much else 0.0
    before, after = slow_power(held_out, {e.name: e.y for e in held_out}), slow_power(held_out, residual)
    weight = held_out[0].vehicle.mass * held_out[0].vehicle.gravity
    if after >= much * before and after >= (0.5 * options.materiality.structure_force * weight) ** 2:
        ratio = np.sqrt(after / max(usual, (weight * options.tolerance.attitude) ** 2))
        probability = max(probability, _above(float(ratio), thresholds.novel, thresholds))
    text = "what unseen flights show is not in these"
    return probability, Finding(UNSEEN, text, probability, {})


def line_test(
    line: Line,
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    options: Options,
) -> Indication:
    """Return the probability of a material spectral line that held-out flights show as well.

    residual: of held-out flights, (m, 15) by flight.
    """
    thresholds = options.thresholds
    loud = line.rms >= least_lines(flights, options.materiality)[line.channel]
    again = strongest_line(held_out, residual).prominence > thresholds.held_out_share * thresholds.line
    text = f"a line in {CHANNELS[line.channel]} at {line.frequency:.2f} Hz"
    figures = {"frequency": line.frequency, "rms": line.rms}
    probability = _above(line.prominence, thresholds.line, thresholds) if loud and again else 0.0
    return probability, Finding("line", text, line.prominence, figures)


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

    torque: `slow_torque` of flights.   residual: of held-out ones.   hidden: may a swing have been lost?
    """
    ratio, share, rms = torque
    thresholds, materiality = options.thresholds, options.materiality
    limit = thresholds.slow_torque
    clear = ratio > thresholds.clear_torque * limit and rms > least_structure(flights, materiality)[1]
    large = share > thresholds.swing_power if hidden else share > materiality.structure_share or clear
    again = slow_torque(held_out, residual)[0] > thresholds.held_out_share * limit
    probability = _above(ratio, limit, thresholds) if large and again else 0.0
    return probability, Finding("slow torque", "a torque that comes and goes", ratio, {"ratio": ratio})


def _above(ratio: float, threshold: float, thresholds: Thresholds) -> float:
    """Probability that a ratio is above what noise has: one half at the threshold."""
    return float(1 / (1 + (threshold / max(ratio, 1e-9)) ** thresholds.steepness))


def material_structure(flights: Sequence[FlightResiduals], materiality: Materiality) -> tuple[float, float]:
    """Return the least RMS force [N] and torque [N·m] of material structure; half of an effect's force, as a part."""
    tau = np.concatenate([e.nominal[:, 3:] - e.nominal[:, 3:].mean(axis=0) for e in flights])
    weight = flights[0].vehicle.mass * flights[0].vehicle.gravity
    commanded = float(np.sqrt(np.mean(np.sum(tau**2, axis=1))))
    return 0.5 * materiality.structure_force * weight, materiality.torque * commanded


def least_structure(flights: Sequence[FlightResiduals], materiality: Materiality) -> np.ndarray:
    """Return (2,) the least RMS force and torque of material structure, smaller for ideal sensors [N, N·m]."""
    return np.array(material_structure(flights, materiality)) * materiality.exactness


def least_lines(flights: Sequence[FlightResiduals], materiality: Materiality) -> np.ndarray:
    """Return (6,) the least RMS of a material line by channel of the wrench [N, N·m]."""
    y = np.concatenate([e.y[:, ev.WRENCH] for e in flights])
    least = np.repeat(least_structure(flights, materiality), 3)
    return np.maximum(np.sqrt(materiality.structure_share * np.mean(y**2, axis=0)), least)
