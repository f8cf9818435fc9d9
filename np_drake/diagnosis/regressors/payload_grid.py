"""Payload columns at many tether lengths at once, or linearised about a guess."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.forward_model import NEVER, STATE, hidden_size, specific_pull, swing_units
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.regressors.library import Onset
from np_drake.diagnosis.regressors.payload import AT_REST, SHAPE, SMALL, Guess, PayloadColumns
from np_drake.diagnosis.residuals import FORCE, TORQUE, FlightResiduals


def payloads_of(
    flights: Sequence[FlightResiduals], lengths: np.ndarray, priors: Priors, onset: Onset | None = None
) -> list[PayloadColumns]:
    """Return payload columns at each fixed tether length.

    Mass, hook (through torque) and the initial swing of every flight are free; there is no damping.

    Args:
        flights: the flights.
        lengths: of tethers [m].
        priors: of mass, hook and swing.
        onset: when the payload is hung, by flight [s].
    """
    lengths = np.asarray(lengths, float)
    rates = np.sqrt(flights[0].vehicle.gravity / lengths)
    swing = np.repeat(np.concatenate([np.zeros((1, STATE)), SMALL * np.eye(STATE)])[None], len(lengths), axis=0)
    swing[:, :, 2:] *= rates[:, None, None]
    many = np.repeat(lengths, 1 + STATE), swing.reshape(-1, STATE)
    pulls = {e.name: _pulls(e, *many, np.zeros(3), onset).reshape(-1, len(lengths), 1 + STATE, 3) for e in flights}
    return [
        _columns(flights, Guess(float(length)), {n: p[:, i] for n, p in pulls.items()}, priors, onset or {})
        for i, length in enumerate(lengths)
    ]


def payload_about(
    flights: Sequence[FlightResiduals], guess: Guess, priors: Priors, onset: Onset | None = None
) -> PayloadColumns:
    """Return payload columns linearised about a guess, with its length and damping free as well.

    Args:
        flights: the flights.
        guess: point of linearisation.
        priors: priors of parameters, swings and onsets.
        onset: onsets by flight [s].
    """
    rate = math.sqrt(flights[0].vehicle.gravity / guess.length)
    pulls = {}
    for e in flights:
        size = hidden_size(e, (onset or {}).get(e.name))
        moves = SMALL * np.diag(swing_units(size, rate))
        swing = guess.at(e.name, size) + np.concatenate([np.zeros((1 + SHAPE, size)), moves])
        lengths, damping = np.full(len(swing), guess.length), np.full(len(swing), guess.damping)
        lengths[1] *= 1 + SMALL
        damping[2] += SMALL
        pulls[e.name] = _pulls(e, lengths, swing, guess.hook, onset, damping)
    return _columns(flights, guess, pulls, priors, onset or {}, shaped=True)


def _columns(
    flights: Sequence[FlightResiduals],
    guess: Guess,
    pulls: Mapping[str, np.ndarray],
    priors: Priors,
    onset: Onset,
    *,
    shaped: bool = False,
) -> PayloadColumns:
    """Return the columns from the pulls at the guess, of other shape (if `shaped`), and at each displaced swing.

    shaped: at a longer tether, and with more damping.
    """
    mass = priors.payload_mass * flights[0].vehicle.mass
    rate = math.sqrt(flights[0].vehicle.gravity / guess.length)
    hooks = [guess.hook, *(priors.hook * np.eye(3))]
    own = {}
    for name, pull in pulls.items():
        force = np.swapaxes(mass * pull, 1, 2)  # (m, 3, k)
        widths = np.array([priors.length, priors.damping, priors.swing]) / SMALL
        more = np.repeat(widths, [int(shaped), int(shaped), pull.shape[1] - 1 - SHAPE * shaped])
        moved = (force[..., 1:] - force[..., :1]) * more
        X = np.zeros((len(force), 6, AT_REST + len(more)))
        X[:, FORCE, 0], X[:, FORCE, AT_REST:] = force[..., 0], moved
        X[:, TORQUE, :AT_REST] = np.stack([force[..., 0] @ attitude.skew(h).T for h in hooks], axis=-1)
        X[:, TORQUE, AT_REST:] = attitude.skew(guess.hook) @ moved
        own[name] = X
    return PayloadColumns(guess, own, onset, mass, rate, priors, shaped)


def _pulls(
    flight: FlightResiduals,
    lengths: np.ndarray,
    swing: np.ndarray,
    hook: np.ndarray,
    onset: Onset | None,
    damping: float | np.ndarray = 0.0,
) -> np.ndarray:
    """Return the specific pulls (m, k, 3) of k payloads (`specific_pull`); zero where the flight has no payload."""
    begin = (onset or {}).get(flight.name)
    if begin == NEVER:
        return np.zeros((len(flight.t), len(lengths), 3))
    return specific_pull(flight, lengths, swing, np.asarray(hook)[None], begin, damping)
