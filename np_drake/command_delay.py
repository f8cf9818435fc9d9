"""Delay from a command to its effect on the rotors, beyond their lag, estimated in flight."""

import numpy as np

from np_drake import attitude, rigid_body
from np_drake.logs.rotor_input import rotor_decay, rotor_speed, rotor_wrench
from np_drake.residual_models.base import Memory
from np_drake.scaling import ratios
from np_drake.vehicle import Vehicle

LONGEST = 6  # delay that is looked for [periods]
FINE = 4  # delays tried in a period [1]
KEPT = LONGEST + 2  # commands that are kept: of the longest delay, and the one that acted before [1]
WINDOW = (
    2.0  # over which the evidence is averaged, at the pace of the paper's vehicle [s]; source: stated prior
)
CHANGED = 1e-3  # prior probability that the delay is not the one believed so far [1]; source: stated prior
CHANNELS = (0, 1, 2)  # of [f_u, tau_m] that tell a delay: thrust, roll, pitch; yaw hardly moves


class DelayFilter:
    """Bayesian choice among delays of whole and broken periods, `FINE` in each.

    The wrench that acts differs from the command, delayed and passed through the rotors' lag, by external wrenches
    and noise. External wrenches change slowly, so that the step of that difference from sample to sample is smallest
    for the true delay. Steps are taken as normal with unknown variance over a sliding window: n samples have the log
    likelihood -n/2 times the sum over thrust, roll and pitch of the log mean square.
    Source: own choice; the criterion is that of `rotor_lag.learned_rotor_lag`.

    Memory: sent (KEPT, 4) commands, the newest first; rotor (4,) lagged rotor speed; acting (d, 4) what acts by each
    delay; error (d, 3) measured less acting; squares (d, 3) mean squares of its steps; seen (1,) steps; delay (1,) that
    is believed [periods / FINE]. Samples with NaN leave the estimate.

    Args: vehicle: with the rotors' lag.   step: between samples and commands [s].   known: delay that training has
    shown, or that is given [s].   track: whether other delays are looked for.
    """

    def __init__(self, vehicle: Vehicle, *, step: float, known: float = 0.0, track: bool = True):
        if not 0 <= known <= LONGEST * step:
            raise ValueError(f"DelayFilter: the delay must be 0 to {LONGEST * step:g} s; got {known:g} s.")
        self.step, self.track, self._vehicle = step, track, vehicle
        self._known = round(FINE * known / step)
        self._decay = rotor_decay(vehicle, step / FINE)
        self._window = WINDOW * ratios(vehicle).clock / step  # [samples]

    def initial_memory(self) -> Memory:
        """Return the memory before any sample: hover, and the delay that is known."""
        hover, many = self._vehicle.hover_input, LONGEST * FINE + 1
        return {
            "sent": np.tile(hover, (KEPT, 1)),
            "rotor": rotor_speed(self._vehicle, hover),
            "acting": np.tile(hover, (many, 1)),
            "error": np.full((many, len(CHANNELS)), np.nan),
            "squares": np.zeros((many, len(CHANNELS))),
            "seen": np.zeros(1),
            "delay": np.array([float(self._known)]),
        }

    def update(self, memory: Memory, *, x: np.ndarray, acceleration: np.ndarray, u: np.ndarray) -> Memory:
        """Return the memory after one more sample.

        Args: x: (13,) state.   acceleration: (6,) [a in W, al in B] [m/s², rad/s²].   u: (4,) command up to now.
        """
        if not np.all(np.isfinite(u)):
            u = memory["sent"][0]
        target = rotor_speed(self._vehicle, u)
        shares = self._decay ** np.arange(FINE, 0, -1)[:, None]  # newest first
        rotor = target + shares * (memory["rotor"] - target)
        acting = np.vstack([rotor_wrench(self._vehicle, rotor), memory["acting"][:-FINE]])
        new = {
            **memory,
            "sent": np.vstack([u, memory["sent"][:-1]]),
            "rotor": rotor[0],
            "acting": acting,
        }
        return new | self._evidence(memory, self._measured(x, acceleration) - acting[:, CHANNELS])

    def _measured(self, x: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Return thrust, roll and pitch torque that explain the motion, were there nothing else (3,) [N, N·m]."""
        q = x[rigid_body.Q]
        wrench = rigid_body.residual_wrench(
            self._vehicle, q=q, w=x[rigid_body.W], a=acceleration[:3], al=acceleration[3:], u=np.zeros(4)
        )
        return np.array([wrench[:3] @ attitude.body_z(q), wrench[3], wrench[4]])

    def _evidence(self, memory: Memory, error: np.ndarray) -> Memory:
        """Return what the step of the error tells of the delay."""
        change = error - memory["error"]
        if not np.all(np.isfinite(change)):
            return {"error": error}
        seen = memory["seen"] + 1
        blend = max(1 / self._window, 1 / seen[0])
        squares = memory["squares"] + blend * (change**2 - memory["squares"])
        new = {"error": error, "squares": squares, "seen": seen}
        if self.track:
            new["delay"] = self._likeliest(squares, min(seen[0], self._window), int(memory["delay"][0]))
        return new

    @staticmethod
    def _likeliest(squares: np.ndarray, samples: float, believed: int) -> np.ndarray:
        """Return the delay of the highest posterior probability (1,) [periods / FINE]."""
        logarithm = -0.5 * samples * np.log(squares + 1e-300).sum(axis=1)
        logarithm[believed] += np.log((1 - CHANGED) * (len(squares) - 1) / CHANGED)
        return np.array([float(np.argmax(logarithm))])

    def delay(self, memory: Memory) -> float:
        """Return the delay that is believed [s]."""
        return float(memory["delay"][0]) * self.step / FINE


def acting_commands(sent: np.ndarray, delay: float) -> np.ndarray:
    """Return the mean command that acts in each period, up to the last that acts whole, (m + 1, 4) [N, N·m].

    The first acted in the period that ends now, m others will.
    Args: sent: (KEPT, 4) commands, the newest first, each sent at the start of a period.   delay: [periods].
    """
    whole = int(delay)
    part = delay - whole
    return (1 - part) * sent[whole::-1] + part * sent[whole + 1 : 0 : -1]


def commands_under_way(sent: np.ndarray, parts: int) -> np.ndarray:
    """Return the commands that will act before the next one does, one each `FINE`-th of a period, (parts, 4).

    Args: sent: (KEPT, 4) commands, the newest first [N, N·m].   parts: the delay [periods / FINE].
    """
    return sent[(np.arange(parts, 0, -1) - 1) // FINE]
