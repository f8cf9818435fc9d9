"""What is left once the causes are taken out: is it noise, or something the library does not have?"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis import evidence as ev
from np_drake.diagnosis.answer import CHANNELS, Finding
from np_drake.diagnosis.attribute import (
    EXACT,
    MATERIAL_FORCE,
    MATERIAL_GAP,
    MATERIAL_TORQUE,
    HeldOut,
    on_held_out,
)
from np_drake.diagnosis.bounds import impossible
from np_drake.diagnosis.candidates import DRAG
from np_drake.diagnosis.evidence import Evidence
from np_drake.diagnosis.excess import LINE, Line, lift_apart, slow_torque, strongest_burst, strongest_line
from np_drake.diagnosis.held_out import adapt
from np_drake.diagnosis.mode import mode_of
from np_drake.diagnosis.refine import Fit, Generic
from np_drake.diagnosis.rig import Tolerance
from np_drake.diagnosis.signature import signature
from np_drake.diagnosis.slow_force import LEAST, slow_force, slow_power
from np_drake.diagnosis.unknown import PREFIX
from np_drake.diagnosis.which import Ranking
from np_drake.effects.base import Effect

SLOW_TORQUE = {True: 12.0, False: 9.0}  # above it a slow torque is no gyro's, on a rig and in a laboratory
CLEAR = 6.0  # times that limit, above which it is a matter however small its share; own choice
LEAST_SHARE = 0.03  # of the gap, and of a channel's power, below which structure is no matter; own choice
FAINT = 0.4  # share of a threshold that unseen flights must show as well; own choice
MUCH = 0.3  # share of the power of a slow force or torque of unseen flights that no good model leaves; own choice
SWUNG = 0.25  # the same, beside a payload: what a swing that is lost at a snap leaves; own choice
NOVEL = 2.0  # times a threshold at which unseen flights alone tell; own choice
BEYOND = 0.9  # probability of something else where an effect needs a figure beyond its bounds; own choice
HARM = -1.0  # log likelihood on unseen flights below which a structure does not repeat
BURST = 8.0  # of a slow force over its usual deviation, above which no noise is; own choice
APART = 5.0  # of a flight's mean lift over what sensors may be off by, above which it is none; own choice
UNSEEN = "unseen flights"  # name of what they alone show
STEEP = 6.0  # of the probability with the logarithm of a ratio; own choice


@dc.dataclass(frozen=True)
class Remains:
    """unknown: is something material left?   findings: where it lives.   held: the fit on unseen flights.

    structured: with measured rotor speed, is there structure beside the effects, whether or not it repeats?
    """

    unknown: bool
    probability: float
    findings: tuple[Finding, ...]
    held: HeldOut
    slow_probability: float
    line: Line
    slow_torque: float
    structured: bool = False

    @property
    def novel(self) -> bool:
        """Do unseen flights alone show something?"""
        return any(f.name == UNSEEN for f in self.findings)


def remains(ranking: Ranking, fit: Fit, flights: Sequence[Evidence], unseen: Sequence[Evidence]) -> Remains:
    """The generic structure of the fit, lines and slow torques in what is left."""
    structured = bool(ranking.fits[0].generic) and flights[0].measured_rotors
    held = on_held_out(ranking.named, unseen, ranking.noise, structured=structured)
    left = {e.name: fit.left(e) for e in flights}
    found = [_generic(g, ranking, flights, left) for g in fit.generic]
    seen = _repeat(ranking, fit, unseen, held)
    least = _least_lines(flights, ranking.tolerance)
    line, (torque, share, rms) = strongest_line(flights, left, least), slow_torque(flights, left)
    limit = SLOW_TORQUE[ranking.tolerance.real]
    swung = {e.name: without_swing(held, e) for e in unseen}
    again = (strongest_line(unseen, swung).prominence, slow_torque(unseen, swung)[0])
    loud = line.rms >= least[line.channel]
    vibrates = _above(line.prominence, LINE) if loud and again[0] > FAINT * LINE else 0.0
    hidden = any(t.swings for t in ranking.named.terms)
    clear = torque > CLEAR * limit and rms > _matters(flights, ranking.tolerance)[1]
    large = share > SWUNG if hidden else share > LEAST_SHARE or clear
    twists = _above(torque, limit) if large and again[1] > FAINT * limit else 0.0
    structure = [
        ranking.probability.get(PREFIX + f.name, 0.0)
        for (f, material), repeats in zip(found, seen, strict=True)
        if material and repeats and f.size > LEAST_SHARE
    ]
    slowly = _slow(ranking, flights, left, unseen, swung)
    usual = slow_power(flights, left)
    gusty = slowly > 0.5
    novel = 0.0 if hidden else _novel(unseen, swung, ranking.tolerance, usual, gusty=gusty)
    every, rest = [*flights, *unseen], {e.name: ranking.named.left(e) for e in flights} | swung
    odd = [] if hidden or gusty else _odd(every, rest, ranking.tolerance)
    named = ranking.named
    why = [impossible(named, i, flights[0].vehicle, gusty=gusty) for i in range(len(named.terms))]
    beyond = [_beyond(t.effect, w) for t, w in zip(named.terms, why, strict=True) if w]
    probability = max([*structure, vibrates, twists, novel, BEYOND if beyond else 0.0, *(p for p, _ in odd)])
    findings = [f for f, _ in found] + [f for p, f in odd if p > 0.5]
    if novel > 0.5:
        findings.append(Finding(UNSEEN, "what unseen flights show is not in these", novel, {}))
    findings += beyond
    if vibrates > 0.5:
        findings.append(_line_finding(line))
    if twists > 0.5:
        findings.append(Finding("slow torque", "a torque that comes and goes", torque, {"ratio": torque}))
    return Remains(probability > 0.5, probability, tuple(findings), held, slowly, line, torque, structured)


def _repeat(ranking: Ranking, fit: Fit, unseen: Sequence[Evidence], held: HeldOut) -> list[bool]:
    """Of each structure: does it help on flights that it was not fitted to, or at least do no harm there?

    Beside the effects that it was fitted with: those that are named without it may stand in its place.
    """
    gains = np.zeros(len(fit.generic))
    for e in unseen if fit.generic else ():
        rows = held.rows[e.name][ranking.noise.phi.shape[1] :]
        terms = adapt(fit.everything, e, ranking.noise)
        parts = [g.part(e) for g in fit.generic]
        left = e.y - signature(e, terms) - sum(parts)
        losses = [np.sum(e.white(ranking.noise, r)[rows] ** 2) for r in (left, *(left + p for p in parts))]
        gains += 0.5 * (np.array(losses[1:]) - losses[0]) / ranking.problem.temperature
    return [bool(gain > HARM) for gain in gains]


def without_swing(held: HeldOut, e: Evidence) -> np.ndarray:
    """(m, 15) what is left of an unseen flight whatever a payload's hidden swing was, shocks apart."""
    return e.bridged(e.y - signature(e, held.settled[e.name]))


def _slow(
    ranking: Ranking,
    flights: Sequence[Evidence],
    left: dict[str, np.ndarray],
    unseen: Sequence[Evidence],
    swung: dict[str, np.ndarray],
) -> float:
    """Probability of a force in the air in what is left of all flights: none where those of the fit show none.

    A drag that was found would feel it however small it is; where none was, it is a matter if it is as large as an
    effect has to be.
    """
    seen = slow_force(flights, left, ranking.tolerance)
    both = slow_force([*flights, *unseen], left | swung, ranking.tolerance)
    felt = any(t.effect.identifier == DRAG for t in ranking.named.terms)
    vehicle = flights[0].vehicle
    least = MATERIAL_FORCE * (1.0 if ranking.tolerance.real else EXACT)
    matters = felt or both.deviation > least * vehicle.mass * vehicle.gravity
    shown = seen.log_evidence > FAINT * LEAST[felt]
    lost = any(t.swings for t in ranking.named.terms) and slow_power(flights, left) < SWUNG * slow_power(
        flights, {e.name: e.y for e in flights}
    )
    return both.probability(felt=felt) if matters and shown and not lost else 0.0


def _novel(
    unseen: Sequence[Evidence],
    left: dict[str, np.ndarray],
    tolerance: Tolerance,
    usual: float,
    *,
    gusty: bool,
) -> float:
    """Probability that unseen flights show something at work which the flights of the fit did not excite.

    A slow force or torque on them is several times what sensors have, and the causes leave much of it. Gusts, which do
    not repeat, are no such force.   usual: slow power that is left of the flights of the fit [N²].
    """
    torque, share, _ = slow_torque(unseen, left)
    twists = _above(torque, NOVEL * SLOW_TORQUE[tolerance.real]) if share > MUCH else 0.0
    before, after = slow_power(unseen, {e.name: e.y for e in unseen}), slow_power(unseen, left)
    weight = unseen[0].vehicle.mass * unseen[0].vehicle.gravity
    if gusty or after < MUCH * before or after < (0.5 * MATERIAL_FORCE * weight) ** 2:
        return twists
    ratio = np.sqrt(after / max(usual, (weight * tolerance.attitude) ** 2))
    return max(twists, _above(float(ratio), NOVEL))


def _odd(
    flights: Sequence[Evidence], left: dict[str, np.ndarray], tolerance: Tolerance
) -> list[tuple[float, Finding]]:
    """What neither noise nor sensors do, whatever the shape, and its probability.

    A payload, whose swing may be lost, and gusts do the like: beside these it is not asked.
    """
    least = 2 * _matters(flights, tolerance)[0]  # no part of an effect, for which a half is enough
    burst, lift = strongest_burst(flights, left), lift_apart(flights, left)
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


def _beyond(effect: Effect, why: str) -> Finding:
    return Finding("beyond bounds", f"{effect.identifier} stands for it: {why}", 1.0, effect.values)


def _above(ratio: float, threshold: float) -> float:
    """Probability that a ratio is above what noise has: one half at the threshold."""
    return float(1 / (1 + (threshold / max(ratio, 1e-9)) ** STEEP))


def _line_finding(line: Line) -> Finding:
    channel = CHANNELS[line.channel]
    text = f"a line in {channel} at {line.frequency:.2f} Hz"
    return Finding("line", text, line.prominence, {"frequency": line.frequency, "rms": line.rms})


def _least(flights: Sequence[Evidence]) -> tuple[float, float]:
    """RMS force [N] and torque [N·m] of structure that is a matter: of a force half an effect's, it may be a part."""
    tau = np.concatenate([e.nominal[:, 3:] - e.nominal[:, 3:].mean(axis=0) for e in flights])
    weight = flights[0].vehicle.mass * flights[0].vehicle.gravity
    return 0.5 * MATERIAL_FORCE * weight, MATERIAL_TORQUE * float(np.sqrt(np.mean(np.sum(tau**2, axis=1))))


def _matters(flights: Sequence[Evidence], tolerance: Tolerance) -> np.ndarray:
    """(2,) the same, less in a laboratory [N, N·m]."""
    return np.array(_least(flights)) * (1.0 if tolerance.real else EXACT)


def _least_lines(flights: Sequence[Evidence], tolerance: Tolerance) -> np.ndarray:
    """(6,) RMS of a line that is a matter in a channel of the wrench: a long flight shows lines that are none."""
    y = np.concatenate([e.y[:, ev.WRENCH] for e in flights])
    least = np.repeat(_matters(flights, tolerance), 3)
    return np.maximum(np.sqrt(LEAST_SHARE * np.mean(y**2, axis=0)), least)


def _generic(
    generic: Generic, ranking: Ranking, flights: Sequence[Evidence], left: dict[str, np.ndarray]
) -> tuple[Finding, bool]:
    """A finding, and whether it is material as an effect would be."""
    noise = ranking.noise
    inverse = np.where(noise.rms > 0, 1 / np.maximum(noise.rms, 1e-12), 0.0)
    part = np.concatenate([generic.part(e) for e in flights])
    y = np.concatenate([e.y for e in flights])
    least_force, least_torque = _least(flights)
    force = np.sqrt(np.mean(np.sum(part[:, ev.FORCE] ** 2, axis=1)))
    torque = np.sqrt(np.mean(np.sum(part[:, ev.TORQUE] ** 2, axis=1)))
    own = np.sum((part * inverse) ** 2)
    gap = own / max(np.sum((y * inverse) ** 2) - y.shape[0] * np.sum(noise.rms > 0), own)
    material = force >= least_force or torque >= least_torque or gap >= MATERIAL_GAP
    candidate = generic.candidate
    figures = {"force": float(force), "torque": float(torque), **candidate.figures}
    text = candidate.variant
    mode = mode_of(generic, flights, left, noise) if candidate.swing is not None else None
    if mode is not None:
        figures["frequency"], figures["damping"] = mode
        text += "; fitted: {frequency:.3g} Hz, damping {damping:.2g}".format(**figures)
    name = candidate.identifiers[0].removeprefix(PREFIX)
    return Finding(name, text, float(gap), figures), bool(material)
