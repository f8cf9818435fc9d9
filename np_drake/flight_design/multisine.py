"""Random multisine of a room: tones with random phases on each axis, from rest to rest, as large as
limits allow.
"""

import dataclasses as dc
from math import comb

import numpy as np

from np_drake.flight_design.limits import Limits
from np_drake.references.ramp import rest_to_rest

LOWEST, HIGHEST, TONES = (
    0.1,
    1.8,
    8,
)  # of x; the tones of y and z lie between them [Hz, Hz, 1]; own choice
CORNER = 0.3  # above which amplitudes fall [Hz]; own choice
FADE = 2.0  # in which the tones fade in and out [s]
SHARE = 0.8  # of the limits that a plan uses, as a vehicle overshoots its reference [1]; own choice
RATE = 50.0  # at which limits are looked at [Hz]
FINEST = 1e-3  # of the largest size, at which the bisection ends [1]


@dc.dataclass(frozen=True)
class FadedMultisine:
    """Reference motion: a sum of sines on each axis about `center`, faded in and out; at rest
    outside.

    center: (3,) in W [m].
    amplitude: (k, 3) of each tone [m].
    frequency: (k, 3) [Hz].
    phase: (k, 3) [rad]. end: length of the motion [s].
    """

    center: np.ndarray
    amplitude: np.ndarray
    frequency: np.ndarray
    phase: np.ndarray
    end: float

    def scaled(self, factor: float) -> "FadedMultisine":
        """Return the motion with all amplitudes times `factor` [1]."""
        return dc.replace(self, amplitude=factor * self.amplitude)

    def usage(self, limits: Limits) -> dict[str, float]:
        """Return the share of each limit that the motion uses, by name [1]."""
        t = np.linspace(0.0, self.end, round(self.end * RATE) + 1)
        return limits.usage(t, self.sample(t))

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        t = np.clip(t, 0.0, self.end)
        rate = 2 * np.pi * self.frequency
        angle = t[:, None, None] * rate + self.phase
        # The k-th derivative of a sine is rate^k times the sine a quarter of a turn, k times,
        # ahead.
        sines = [
            np.sum(self.amplitude * rate**k * np.sin(angle + 0.5 * k * np.pi), axis=1)
            for k in range(5)
        ]
        fade = min(FADE, 0.4 * self.end)
        rise, fall = _step(t, fade), _step(self.end - t, fade) * (-1.0) ** np.arange(5)[:, None]
        flat = _product(_product(rise, fall)[..., None], np.stack(sines))
        flat[0] += self.center
        return flat


def random_multisine(
    limits: Limits, seconds: float, *, seed: int, share: float = SHARE
) -> FadedMultisine:
    """Return the largest multisine of random phases that keeps the limits.

    Source: own study: random motion within the limits separates explanations as well as an
    optimised one.

    Args:
        seconds: length of the flight [s].
        share: of each limit that may be used [1].
    """
    ratio = (HIGHEST / LOWEST) ** (1 / (TONES - 1))
    tone = LOWEST * ratio ** (np.arange(TONES)[:, None] + np.arange(3) / 3)
    phase = np.random.default_rng(seed).uniform(0.0, 2 * np.pi, tone.shape)
    # Amplitudes fall with the cube of frequency above the corner, acceleration as its inverse: fast
    # tones, which take tilt and thrust, then leave some of both for the speed that drag needs.
    amplitude = limits.half * np.minimum(1.0, CORNER / tone) ** 3
    return largest(FadedMultisine(limits.center, amplitude, tone, phase, seconds), limits, share)


def largest(motion: FadedMultisine, limits: Limits, share: float) -> FadedMultisine:
    """Return the motion scaled to the largest size that uses at most a share of each limit.

    Args:
        share: of each limit that may be used [1].
    """
    motion = motion.scaled(share / motion.usage(limits)["room"])  # no limit allows more
    low, high = 0.0, 1.0
    while high - low > FINEST:
        size = 0.5 * (low + high)
        kept = max(motion.scaled(size).usage(limits).values()) <= share
        low, high = (size, high) if kept else (low, size)
    return motion.scaled(low)


def _step(t: np.ndarray, duration: float) -> np.ndarray:
    """Return a step from 0 to 1 over `duration` [s] and its four derivatives, (5, n), which are
    zero outside.
    """
    step = rest_to_rest(t / duration, duration)
    step[1:, (t <= 0.0) | (t >= duration)] = 0.0
    return step


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the derivatives of a product from those of its factors, (5, ...) (Leibniz)."""
    return np.stack([sum(comb(k, i) * a[i] * b[k - i] for i in range(k + 1)) for k in range(5)])
