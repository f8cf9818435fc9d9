"""Delay from a command to its effect on the rotors, beyond their lag, estimated in flight."""

import dataclasses as dc

import numpy as np

from np_drake import attitude, rigid_body
from np_drake.compiled import finite
from np_drake.residual_model import Memory
from np_drake.rotor_input import rotor_decay, rotor_speed, rotor_wrench
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import ratios

LONGEST_DELAY = 6  # delay that is looked for [periods]
FINE = 4  # delays tried in a period [1]
KEPT = LONGEST_DELAY + 34  # commands that are kept: of the longest delay, and of the lag before [1]
# over which evidence is averaged, at the paper's vehicle's pace [s]; source: stated prior
WINDOW = 2.0
# prior probability that the delay is not the one believed so far [1]; source: stated prior
CHANGED = 1e-3
# Two steps share a reading, so that n of them tell less: 1 + 2 rho² of the squares of differenced
# white noise [1].
SHARED = 1.5
# Lags that are tried where none is known, at the paper's vehicle's pace [s]; source: own choice,
# small to large motors.
LAGS = (0.0, 0.01, 0.02, 0.03, 0.045, 0.065, 0.09)
CHANNELS = (0, 1, 2)  # of [f_u, tau_m] that tell a delay: thrust, roll, pitch; yaw hardly moves


class DelayFilter:
    """Bayesian choice among delays of whole and broken periods, `FINE` in each.

    The wrench that acts differs from the command, delayed and passed through the rotors' lag, by
    external wrenches and noise. External wrenches change slowly, so that the step of that
    difference from sample to sample is smallest for the true delay. Steps are taken as normal with
    unknown variance over a sliding window: n samples have the log likelihood -n/2 times the sum
    over thrust, roll and pitch of the log mean square. Where no lag of the rotors is known, several
    are tried with every delay, and the likeliest counts: a lag must not be taken for a delay.

    Args:
        vehicle: with the rotors' lag, 0 where it is not known.
        step: between samples and commands [s].
        known: delay that training has shown, or that is given [s].
    Source: own choice; the criterion is that of `actuator_timing.learned_timing`.

    Memory, of l lags and d delays: sent (KEPT, 4) commands, the newest first; rotor (l, 4) lagged
    rotor speed; acting (l, d, 4) what acts by each delay; error (l, d, 3) measured less acting;
    squares (l, d, 3) mean squares of its steps; seen (1,) steps; delay (1,) that is believed
    [periods / FINE]. Samples with NaN leave the estimate.
    """

    def __init__(self, vehicle: Vehicle, *, step: float, known: float = 0.0, track: bool = True):
        if not 0 <= known <= LONGEST_DELAY * step:
            raise ValueError(
                f"DelayFilter: the delay must be 0 to {LONGEST_DELAY * step:g} s; got {known:g} s."
            )
        self.step = step
        self.track = track
        self._vehicle = vehicle
        self._known = round(FINE * known / step)
        pace = ratios(vehicle).clock
        known_lag = vehicle.rotor_time_constant
        lags = (known_lag,) if known_lag > 0 else tuple(pace * lag for lag in LAGS)
        decay = [
            rotor_decay(dc.replace(vehicle, rotor_time_constant=lag), step / FINE) for lag in lags
        ]
        # Of the fine steps of a period, the newest first, (l, FINE, 1).
        self._shares = np.array(decay)[:, None, None] ** np.arange(FINE, 0, -1)[:, None]
        self._window = WINDOW * pace / step  # [samples]

    def initial_memory(self) -> Memory:
        """Return the memory before any sample: hover, and the delay that is known."""
        hover = self._vehicle.hover_input
        lags = len(self._shares)
        delays = LONGEST_DELAY * FINE + 1
        return {
            "sent": np.tile(hover, (KEPT, 1)),
            "rotor": np.tile(rotor_speed(self._vehicle, hover), (lags, 1)),
            "acting": np.tile(hover, (lags, delays, 1)),
            "error": np.full((lags, delays, len(CHANNELS)), np.nan),
            "squares": np.zeros((lags, delays, len(CHANNELS))),
            "seen": np.zeros(1),
            "delay": np.array([float(self._known)]),
        }

    def update(
        self, memory: Memory, *, x: np.ndarray, acceleration: np.ndarray, u: np.ndarray
    ) -> Memory:
        """Return the memory after one more sample.

        Args:
            x: (13,) state.
            acceleration: (6,) [a in W, al in B], [m/s², rad/s²].
            u: (4,) command up to now.
        """
        sent = newest_first(memory["sent"], u)
        target = rotor_speed(self._vehicle, sent[0])
        rotor = target + self._shares * (memory["rotor"][:, None] - target)
        acting = np.concatenate(
            [rotor_wrench(self._vehicle, rotor), memory["acting"][:, :-FINE]], axis=1
        )
        new = {**memory, "sent": sent, "rotor": rotor[:, 0], "acting": acting}
        return new | self._evidence(memory, self._measured(x, acceleration) - acting[..., CHANNELS])

    def _measured(self, x: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Return thrust, roll and pitch torque that explain the motion, were there nothing else
        (3,) [N, N·m].
        """
        q = x[rigid_body.Q]
        wrench = rigid_body.residual_wrench(
            self._vehicle,
            q=q,
            w=x[rigid_body.W],
            a=acceleration[:3],
            al=acceleration[3:],
            u=np.zeros(4),
        )
        return np.array([wrench[:3] @ attitude.body_z(q), wrench[3], wrench[4]])

    def _evidence(self, memory: Memory, error: np.ndarray) -> Memory:
        """Return what the step of the error tells of the delay."""
        change = error - memory["error"]
        if not finite(change):
            return {"error": error}
        seen = memory["seen"] + 1
        blend = max(1 / self._window, 1 / seen[0])
        squares = memory["squares"] + blend * (change**2 - memory["squares"])
        new = {"error": error, "squares": squares, "seen": seen}
        if self.track:
            # Log likelihood of normal steps with these mean squares, each channel's variance
            # unknown; of every delay the likeliest lag, and of all the likeliest delay.
            factor = -0.5 * (min(seen[0], self._window) / SHARED)
            logarithm = (factor * np.log(squares + 1e-300).sum(axis=-1)).max(axis=0)
            logarithm[int(memory["delay"][0])] += believed_before(len(logarithm))
            new["delay"] = np.array([float(np.argmax(logarithm))])
        return new

    def delay(self, memory: Memory) -> float:
        """Return the delay that is believed [s]."""
        return float(memory["delay"][0]) * self.step / FINE


def believed_before(count: int) -> float:
    """Return the logarithm of the prior odds of the delay believed so far over another one of
    `count` [1].
    """
    return float(np.log((1 - CHANGED) * max(count - 1, 1) / CHANGED))


def newest_first(sent: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return the commands sent with one more, the newest first, (KEPT, 4).

    Args:
        sent: (KEPT, 4) commands, the newest first [N, N·m].
        u: (4,) new command; one with NaN is taken as the last again.
    """
    return np.vstack([u if finite(u) else sent[0], sent[:-1]])


def acting_command(sent: np.ndarray, delay: float) -> np.ndarray:
    """Return the mean command that acted in the period that ends now, (4,) [N, N·m].

    Args:
        sent: (KEPT, 4) commands, the newest first, each sent at the start of a period.
        delay: [periods].
    """
    full = int(delay)
    part = delay - full
    return (1 - part) * sent[full] + part * sent[full + 1]


def commands_under_way(sent: np.ndarray, parts: int) -> np.ndarray:
    """Return the commands that will act before the next one does, one each `FINE`-th of a period,
    (parts, 4).

    Args:
        sent: (KEPT, 4) commands, the newest first [N, N·m].
        parts: the delay [periods / FINE].
    """
    return sent[(np.arange(parts, 0, -1) - 1) // FINE]
