"""A payload as columns of the regression: one candidate for every tether length."""

import math
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis import evidence as ev
from np_drake.diagnosis.candidates import Candidate, Onset
from np_drake.diagnosis.evidence import Evidence
from np_drake.diagnosis.hidden_swing import STATE, specific_pull
from np_drake.diagnosis.signature import NEVER, Term
from np_drake.effects.library import LIBRARY

SWING = 0.15  # prior deviation of an initial swing [rad]
HOOK = 0.1  # prior deviation of the hook [m]


def payload_candidates(
    flights: Sequence[Evidence], lengths: np.ndarray, onset: Onset | None = None
) -> list[Candidate]:
    """A payload at each tether length: mass, hook (through torque), and the initial swing of every flight."""
    if "suspended_payload" not in LIBRARY:
        return []
    onset = onset or {}
    effect = LIBRARY["suspended_payload"]
    mass = 0.1 * flights[0].vehicle.mass
    rates = np.sqrt(flights[0].vehicle.gravity / lengths)
    pulls = {e.name: _pulls(e, lengths, rates, onset.get(e.name)) for e in flights}
    total = 1 + 3 + STATE * len(flights)
    out = []
    for i, length in enumerate(lengths):
        columns = {}
        for position, e in enumerate(flights):
            X = np.zeros((*e.y.shape, total))
            at_rest = mass * pulls[e.name][:, i, 0]
            X[:, ev.FORCE, 0] = at_rest
            for axis in range(3):
                X[:, ev.TORQUE, 1 + axis] = np.cross(HOOK * np.eye(3)[axis], at_rest)
            start = 4 + STATE * position
            for k in range(STATE):
                moved = mass * (pulls[e.name][:, i, 1 + k] - pulls[e.name][:, i, 0])
                X[:, ev.FORCE, start + k] = moved * (SWING / 0.02)
            columns[e.name] = X

        def terms(c: np.ndarray, length: float = float(length), rate: float = float(rates[i])) -> list[Term]:
            share = max(c[0], 0.02)
            hook = np.clip(c[1:4] / share * HOOK, -0.5, 0.5)
            scale = SWING * np.array([1.0, 1.0, rate, rate]) / share
            hidden = {
                e.name: np.clip(c[4 + STATE * j : 4 + STATE * (j + 1)], -4, 4) * scale
                for j, e in enumerate(flights)
            }
            most = 1.2 * np.array([1, 1, rate, rate])
            hidden = {name: np.clip(v, -most, most) for name, v in hidden.items()}
            values = {"mass": share * mass, "length": length}
            values |= dict(zip(("hook_x", "hook_y", "hook_z"), hook.tolist(), strict=True))
            return [Term(effect.of(values), onset, hidden)]

        out.append(
            Candidate(
                ("suspended_payload",),
                f"length={length:.3g}",
                columns,
                terms,
                -math.log(len(lengths)),
                onset,
                _hangs,
            )
        )
    return out


def _hangs(c: np.ndarray) -> bool:
    """A payload weighs something, and does not swing further than a payload can."""
    return bool(c[0] > 0.01 and np.all(np.abs(c[4:]) < 7.0 * c[0]))


def _pulls(evidence: Evidence, lengths: np.ndarray, rates: np.ndarray, onset: float | None) -> np.ndarray:
    """(m, lengths, 1 + STATE, 3): pull at rest, and with 0.02 rad (or rad times the natural rate) in each swing."""
    if onset == NEVER:
        return np.zeros((len(evidence.t), len(lengths), 1 + STATE, 3))
    small = np.concatenate([np.zeros((1, STATE)), 0.02 * np.eye(STATE)])
    swing = np.repeat(small[None], len(lengths), axis=0)
    swing[:, :, 2:] *= rates[:, None, None]
    many = specific_pull(
        evidence, np.repeat(lengths, 1 + STATE), swing.reshape(-1, STATE), np.zeros((1, 3)), onset
    )
    return many.reshape(len(evidence.t), len(lengths), 1 + STATE, 3)
