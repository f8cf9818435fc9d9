"""What neither noise nor sensors do, in what the named effects leave of flights: each with its probability."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.adequacy.residual_statistics import (
    LINE,
    Line,
    lift_apart,
    slow_torque,
    strongest_burst,
    strongest_line,
)
from np_drake.diagnosis.fitting import Fit, impossible
from np_drake.diagnosis.materiality import EXACT, MATERIAL_FORCE, MATERIAL_TORQUE
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.residuals import flight_residuals as ev
from np_drake.diagnosis.result import CHANNELS, Finding
from np_drake.diagnosis.tolerance import Tolerance
from np_drake.diagnosis.wind import slow_power
from np_drake.vehicle import Vehicle

SLOW_TORQUE = {True: 12.0, False: 9.0}  # above it a slow torque is no gyro's, on a rig and in a laboratory
CLEAR = 6.0  # times that limit, above which it is a matter however small its share; own choice
LEAST_SHARE = 0.03  # of the gap, and of a channel's power, below which structure is no matter; own choice
FAINT = 0.4  # share of a threshold that unseen flights must show as well; own choice
MUCH = 0.3  # share of the power of a slow force or torque of unseen flights that no good model leaves; own choice
SWUNG = 0.25  # the same, beside a payload: what a swing that is lost at a snap leaves; own choice
NOVEL = 2.0  # times a threshold at which unseen flights alone tell; own choice
BEYOND = 0.9  # probability of something else where an effect needs a figure beyond its bounds; own choice
BURST = 8.0  # of a slow force over its usual deviation, above which no noise is; own choice
APART = 5.0  # of a flight's mean lift over what sensors may be off by, above which it is none; own choice
UNSEEN = "unseen flights"  # name of what they alone show
STEEP = 6.0  # of the probability with the logarithm of a ratio; own choice

Indication = tuple[float, Finding]  # what there may be, and how probable that is


def irregularities(
    flights: Sequence[FlightResiduals], residual: dict[str, np.ndarray], tolerance: Tolerance
) -> list[Indication]:
    """What neither noise nor sensors do, whatever the shape, and its probability.

    A payload, whose swing may be lost, and gusts do the like: beside these it is not asked.
    """
    least = 2 * least_structure(flights, tolerance)[0]  # no part of an effect, for which a half is enough
    burst, lift = strongest_burst(flights, residual), lift_apart(flights, residual)
    apart = lift / (flights[0].vehicle.mass * tolerance.acceleration)
    axis, figures = CHANNELS[burst.axis], {"time": burst.time, "force": burst.size}
    now = f"a {axis} that comes now and then, as in {burst.flight} at {burst.time:.1f} s, {burst.size:.2g} N"
    other = f"a mean lift that differs from flight to flight, {lift:.2g} N"
    bursts = _above(burst.prominence, BURST) if burst.size > least else 0.0
    differs = _above(apart, APART) if lift > least else 0.0
    return [
        (bursts, Finding("burst", now, burst.prominence, figures)),
        (differs, Finding("lift", other, apart, {"force": lift})),
    ]


def novel_on_held_out(
    held_out: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    tolerance: Tolerance,
    usual: float,
    *,
    gusty: bool,
) -> Indication:
    """Do unseen flights show something at work which the flights of the fit did not excite?

    A slow force or torque on them is several times what sensors have, and the causes leave much of it. Gusts, which do
    not repeat, are no such force.   usual: slow power that is left of the flights of the fit [N²].
    """
    torque, share, _ = slow_torque(held_out, residual)
    probability = _above(torque, NOVEL * SLOW_TORQUE[tolerance.real]) if share > MUCH else 0.0
    before, after = slow_power(held_out, {e.name: e.y for e in held_out}), slow_power(held_out, residual)
    weight = held_out[0].vehicle.mass * held_out[0].vehicle.gravity
    if not gusty and after >= MUCH * before and after >= (0.5 * MATERIAL_FORCE * weight) ** 2:
        ratio = np.sqrt(after / max(usual, (weight * tolerance.attitude) ** 2))
        probability = max(probability, _above(float(ratio), NOVEL))
    text = "what unseen flights show is not in these"
    return probability, Finding(UNSEEN, text, probability, {})


def line_test(
    line: Line,
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    tolerance: Tolerance,
) -> Indication:
    """Is there a line that matters, and that unseen flights show as well?   left: of these."""
    loud = line.rms >= least_lines(flights, tolerance)[line.channel]
    again = strongest_line(held_out, residual).prominence > FAINT * LINE
    text = f"a line in {CHANNELS[line.channel]} at {line.frequency:.2f} Hz"
    figures = {"frequency": line.frequency, "rms": line.rms}
    probability = _above(line.prominence, LINE) if loud and again else 0.0
    return probability, Finding("line", text, line.prominence, figures)


def slow_torque_test(
    torque: tuple[float, float, float],
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    tolerance: Tolerance,
    *,
    hidden: bool,
) -> Indication:
    """Is there a slow torque that matters, and that unseen flights show as well?

    torque: `slow_torque` of flights.   left: of unseen ones.   hidden: may a swing have been lost?
    """
    ratio, share, rms = torque
    limit = SLOW_TORQUE[tolerance.real]
    clear = ratio > CLEAR * limit and rms > least_structure(flights, tolerance)[1]
    large = share > SWUNG if hidden else share > LEAST_SHARE or clear
    again = slow_torque(held_out, residual)[0] > FAINT * limit
    probability = _above(ratio, limit) if large and again else 0.0
    return probability, Finding("slow torque", "a torque that comes and goes", ratio, {"ratio": ratio})


def beyond_bounds(named: Fit, vehicle: Vehicle, *, gusty: bool) -> list[Indication]:
    """Effects that need a figure which they cannot have."""
    why = [impossible(named, i, vehicle, gusty=gusty) for i in range(len(named.terms))]
    return [
        (BEYOND, Finding("beyond bounds", f"{e.identifier} stands for it: {w}", 1.0, e.values))
        for e, w in zip((t.effect for t in named.terms), why, strict=True)
        if w
    ]


def _above(ratio: float, threshold: float) -> float:
    """Probability that a ratio is above what noise has: one half at the threshold."""
    return float(1 / (1 + (threshold / max(ratio, 1e-9)) ** STEEP))


def material_structure(flights: Sequence[FlightResiduals]) -> tuple[float, float]:
    """RMS force [N] and torque [N·m] of structure that is a matter: of a force half an effect's, it may be a part."""
    tau = np.concatenate([e.nominal[:, 3:] - e.nominal[:, 3:].mean(axis=0) for e in flights])
    weight = flights[0].vehicle.mass * flights[0].vehicle.gravity
    return 0.5 * MATERIAL_FORCE * weight, MATERIAL_TORQUE * float(np.sqrt(np.mean(np.sum(tau**2, axis=1))))


def least_structure(flights: Sequence[FlightResiduals], tolerance: Tolerance) -> np.ndarray:
    """(2,) the same, less in a laboratory [N, N·m]."""
    return np.array(material_structure(flights)) * (1.0 if tolerance.real else EXACT)


def least_lines(flights: Sequence[FlightResiduals], tolerance: Tolerance) -> np.ndarray:
    """(6,) RMS of a line that is a matter in a channel of the wrench: a long flight shows lines that are none."""
    y = np.concatenate([e.y[:, ev.WRENCH] for e in flights])
    least = np.repeat(least_structure(flights, tolerance), 3)
    return np.maximum(np.sqrt(LEAST_SHARE * np.mean(y**2, axis=0)), least)
