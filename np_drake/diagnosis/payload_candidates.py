"""A payload as columns of the regression, linear about a guess of its length, its hook and its swing."""

import dataclasses as dc
import math
from collections.abc import Sequence

import numpy as np
from scipy import special

from np_drake import attitude
from np_drake.diagnosis import evidence as ev
from np_drake.diagnosis.candidates import Candidate, Mended, Onset
from np_drake.diagnosis.evidence import Evidence
from np_drake.diagnosis.hidden_swing import STATE, hidden_size, padded, specific_pull, swing_units
from np_drake.diagnosis.signature import NEVER, Term
from np_drake.effects.library import LIBRARY

SWING = 0.15  # prior deviation of an initial swing [rad]
HOOK = 0.1  # prior deviation of the hook [m]
LENGTH = 0.05  # prior deviation of the length about a guess, relative [1]
SMALL = 0.02  # difference quotients: of a swing [rad], of a length, relative [1]
WIDEST = 1.2  # swing [rad], and with the natural rate its rate, that a guess may have
LONGEST, SHORTEST = 3.0, 0.1  # tether [m]
SURELY = 2.0  # deviations that a mass is at least above zero [1]; own choice


@dc.dataclass(frozen=True)
class Guess:
    """length [m]; hook (3,) [m]; swing by flight: angles [rad] and rates [rad/s], at the start and jumps (`jumps`).

    What is missing is zero.
    """

    length: float
    hook: np.ndarray = dc.field(default_factory=lambda: np.zeros(3))
    swing: dict[str, np.ndarray] = dc.field(default_factory=dict)

    def at(self, flight: str, size: int) -> np.ndarray:
        """(size,) swing in a flight."""
        return padded(self.swing.get(flight), size)


def payload_candidates(
    flights: Sequence[Evidence], lengths: np.ndarray, onset: Onset | None = None
) -> list[Candidate]:
    """A payload at each tether length (as it is): mass, hook (through torque), and the initial swing of every flight.

    All lengths together cost little more than one.
    """
    if "suspended_payload" not in LIBRARY:
        return []
    lengths = np.asarray(lengths, float)
    rates = np.sqrt(flights[0].vehicle.gravity / lengths)
    swing = np.repeat(
        np.concatenate([np.zeros((1, STATE)), SMALL * np.eye(STATE)])[None], len(lengths), axis=0
    )
    swing[:, :, 2:] *= rates[:, None, None]
    many = np.repeat(lengths, 1 + STATE), swing.reshape(-1, STATE)
    pulls = {
        e.name: _pulls(e, *many, np.zeros(3), onset).reshape(-1, len(lengths), 1 + STATE, 3) for e in flights
    }
    return [
        _candidate(flights, Guess(float(length)), {n: p[:, i] for n, p in pulls.items()}, onset or {})
        for i, length in enumerate(lengths)
    ]


def payload_about(flights: Sequence[Evidence], guess: Guess, onset: Onset | None = None) -> Candidate:
    """A payload about a guess; its length is free too."""
    rate = math.sqrt(flights[0].vehicle.gravity / guess.length)
    pulls = {}
    for e in flights:
        size = hidden_size(e, (onset or {}).get(e.name))
        moves = SMALL * np.diag(swing_units(size, rate))
        swing = guess.at(e.name, size) + np.concatenate([np.zeros((1, size)), moves, np.zeros((1, size))])
        lengths = guess.length * np.array([1.0] * (1 + size) + [1.0 + SMALL])
        pulls[e.name] = _pulls(e, lengths, swing, guess.hook, onset)
    return _candidate(flights, guess, pulls, onset or {}, longer=True)


def _candidate(
    flights: Sequence[Evidence],
    guess: Guess,
    pulls: dict[str, np.ndarray],
    onset: Onset,
    *,
    longer: bool = False,
) -> Candidate:
    """From the pull at the guess, with a little more of each swing, and (if `longer`) of the length."""
    mass = 0.1 * flights[0].vehicle.mass
    rate = math.sqrt(flights[0].vehicle.gravity / guess.length)
    first = 4 + int(longer)
    sizes = {n: p.shape[1] - 1 - int(longer) for n, p in pulls.items()}
    begins = dict(zip(sizes, np.cumsum([first, *sizes.values()]).tolist(), strict=False))
    columns = {}
    for e in flights:
        X = np.zeros((*e.y.shape, first + sum(sizes.values())))
        at_guess, moved = mass * pulls[e.name][:, :1], mass * (pulls[e.name][:, 1:] - pulls[e.name][:, :1])
        more = np.repeat([SWING / SMALL, LENGTH / SMALL], [sizes[e.name], int(longer)])
        force = np.concatenate([at_guess, moved * more[:, None]], axis=1)
        swung = np.arange(begins[e.name], begins[e.name] + sizes[e.name])
        at = np.concatenate([[0], swung, np.full(int(longer), first - 1)])
        X[:, ev.FORCE][..., at] = np.swapaxes(force, 1, 2)
        X[:, ev.TORQUE][..., at] = np.swapaxes(force @ attitude.skew(guess.hook).T, 1, 2)
        for axis in range(3):
            X[:, ev.TORQUE, 1 + axis] = at_guess[:, 0] @ attitude.skew(HOOK * np.eye(3)[axis]).T
        columns[e.name] = X
    effect = LIBRARY["suspended_payload"]

    def terms(c: np.ndarray) -> list[Term]:
        share = max(c[0], 0.02)
        hook = np.clip(guess.hook + c[1:4] / share * HOOK, -0.5, 0.5)
        stretch = np.clip(c[4] / share * LENGTH, -0.2, 0.2) if longer else 0.0
        hidden = {}
        for name, size in sizes.items():
            units = swing_units(size, rate)
            move = np.clip(c[begins[name] : begins[name] + size] / share, -4.0, 4.0) * SWING
            hidden[name] = np.clip(guess.at(name, size) + move * units, -WIDEST * units, WIDEST * units)
        length = float(np.clip(guess.length * (1 + stretch), SHORTEST, LONGEST))
        values = {"mass": share * mass, "length": length}
        values |= dict(zip(("hook_x", "hook_y", "hook_z"), hook.tolist(), strict=True))
        return [Term(effect.of(values), onset, hidden)]

    return Candidate(
        ("suspended_payload",),
        f"length={guess.length:.3g}",
        columns,
        terms,
        _log_prior(guess, sizes, rate),
        onset,
        lambda c: _hangs(c, first),
        heavy_enough,
    )


def _log_prior(guess: Guess, sizes: dict[str, int], rate: float) -> float:
    """Of the swings of a guess: what moves it from there has its own prior."""
    relative = [guess.at(name, size) / (SWING * swing_units(size, rate)) for name, size in sizes.items()]
    return -0.5 * float(np.sum(np.concatenate(relative) ** 2))


def heavy_enough(mean: np.ndarray, covariance: np.ndarray) -> Mended:
    """The coefficients (k,), the mass first, with one that is surely positive, and the log probability that it is.

    mean (k,), covariance (k, k): of the posterior, in units of the prior's deviations.

    Where files may be off by as much as a payload weighs, hook and swing are known by their products with the mass:
    with a mass that is too small, or negative, they would be too wide to come back from.
    Source: conditioning of the posterior; own choice of `SURELY`.
    """
    deviation = math.sqrt(covariance[0, 0])
    log_probability = float(special.log_ndtr(mean[0] / deviation))
    if mean[0] >= SURELY * deviation:
        return mean, log_probability
    more = covariance[:, 0] / covariance[0, 0] * (SURELY * deviation - mean[0])
    return mean + more, log_probability


def _hangs(c: np.ndarray, first: int) -> bool:
    """A payload weighs something, and does not swing further than a payload can."""
    return bool(c[0] > 0.01 and np.all(np.abs(c[first:]) < 7.0 * c[0]))


def _pulls(
    evidence: Evidence, lengths: np.ndarray, swing: np.ndarray, hook: np.ndarray, onset: Onset | None
) -> np.ndarray:
    """(m, k, 3) specific pulls of k payloads (`specific_pull`); zero where there is none in this flight."""
    begin = (onset or {}).get(evidence.name)
    if begin == NEVER:
        return np.zeros((len(evidence.t), len(lengths), 3))
    return specific_pull(evidence, lengths, swing, np.asarray(hook)[None], begin)
