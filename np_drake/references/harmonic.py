"""Closed tracks as short Fourier sums: circle, lemniscate, and a lemniscate that stands upright."""

import math

import numpy as np
import scipy

from np_drake.compiled import compiled
from np_drake.files.yaml_file import check_numbers
from np_drake.references.base import require_positive
from np_drake.references.ramp import compose, ramped_phase


class HarmonicTrack:
    """Track p(phase) = center + sum_h amplitude_h cos(h phase + shift_h) at constant phase rate
    after a ramp.

    Args:
        center: (3,) [m].   amplitudes, shifts: (H, 3) [m, rad] for the harmonics 1 … H.
        speed: mean speed along the track [m/s].   ramp: time from rest to full phase rate [s].
    """

    def __init__(self, center, amplitudes, shifts, *, speed: float, ramp: float):
        require_positive("track", "m/s", speed=speed)
        check_numbers("track: ramp", ramp, "s")
        self.center = np.array(center, float)
        self.amplitudes = np.array(amplitudes, float)
        self.shifts = np.array(shifts, float)
        self.ramp = ramp
        self.rate = 2 * np.pi * speed / self.length()

    def path(self, phase: np.ndarray) -> np.ndarray:
        """Return the track and its four derivatives by phase, (5, n, 3), at phases (n,) [rad]."""
        harmonics = np.arange(1.0, 1.0 + len(self.amplitudes))[:, None] * np.ones(3)
        path = _tones(np.ascontiguousarray(phase), harmonics, self.amplitudes, self.shifts)
        path[0] += self.center
        return path

    def length(self) -> float:
        """Return the length of one lap [m]."""

        def arc(phase: float) -> float:
            return float(np.linalg.norm(self.path(np.array([phase]))[1, 0]))

        return float(scipy.integrate.quad(arc, 0.0, 2 * np.pi, limit=200)[0])

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        phase = ramped_phase(t, self.rate, self.ramp)
        return compose(self.path(phase[0]), phase)


def circle(*, radius: float, height: float, speed: float, ramp: float) -> HarmonicTrack:
    """Return the circle x = r cos, y = r sin at constant height.

    Args:
        radius: r [m].
        height: [m].
        speed: [m/s].
        ramp: time from rest to full speed [s].
    Raises: ValueError: on an impossible size.
    """
    require_positive("circle", "m", radius=radius)
    return HarmonicTrack(
        [0, 0, height], [[radius, radius, 0.0]], [[0.0, -np.pi / 2, 0.0]], speed=speed, ramp=ramp
    )


def lemniscate(
    *, length: float, width: float, height: float, speed: float, ramp: float
) -> HarmonicTrack:
    """Return the lemniscate x = length cos, y = width sin(2 ·) at constant height.

    Args:
        length: half the extent along x [m].
        width: half that along y [m].
        height: [m].
        speed: mean along the track [m/s].
        ramp: time from rest to full speed [s].
    Raises: ValueError: on an impossible size.
    """
    require_positive("lemniscate", "m", length=length, width=width)
    return HarmonicTrack(
        [0, 0, height],
        [[length, 0.0, 0.0], [0.0, width, 0.0]],
        [[0.0, 0.0, 0.0], [0.0, -np.pi / 2, 0.0]],
        speed=speed,
        ramp=ramp,
    )


def vertical_lemniscate(
    *, length: float, rise: float, height: float, speed: float, ramp: float
) -> HarmonicTrack:
    """Return the upright lemniscate x = length cos, z = height + rise sin(2 ·), in the plane y = 0.

    It climbs and descends twice a lap while it swings the payload along x.

    Args:
        length: half the extent along x [m].
        rise: half that along z [m].
        height: of the middle [m].
        speed: mean along the track [m/s].
        ramp: time from rest to full speed [s].
    Raises: ValueError: on an impossible size.
    """
    require_positive("vertical lemniscate", "m", length=length, rise=rise)
    return HarmonicTrack(
        [0, 0, height],
        [[length, 0.0, 0.0], [0.0, 0.0, rise]],
        [[0.0, 0.0, 0.0], [0.0, 0.0, -np.pi / 2]],
        speed=speed,
        ramp=ramp,
    )


class Multisine:
    """Sum of sines at incommensurate frequencies in each axis, faded in with the ramp by its phase.

    All tones of an axis have the same velocity amplitude, and their sum has the RMS given (about
    its own mean; it starts at zero offset). Source: own choice: training on a circle without dither
    yields a spurious force per vz.

    Args:
        amplitude: (3,) RMS of the dither per axis [m].
        frequencies: of the tones of x [Hz]; y and z take tones between them, so that no two axes
            share one.
        ramp: [s].
        seed: of the tones' phases.
    """

    def __init__(
        self, amplitude, frequencies=(0.23, 0.41, 0.67, 0.97), *, ramp: float = 5.0, seed: int = 0
    ):
        self.frequencies = np.array(frequencies)[:, None] * np.array([1.0, 1.13, 1.27])
        share = 1 / self.frequencies
        self.amplitude = (
            np.array(amplitude, float) * share / np.sqrt(0.5 * np.sum(share**2, axis=0))
        )
        self.shift = np.random.default_rng(seed).uniform(0, 2 * np.pi, share.shape) - np.pi / 2
        self.ramp = ramp

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]; starts at rest at
        zero offset.
        """
        warped = ramped_phase(t, 1.0, self.ramp)
        path = _tones(warped[0], 2 * np.pi * self.frequencies, self.amplitude, self.shift)
        path[0] -= np.sum(self.amplitude * np.cos(self.shift), axis=0)
        return compose(path, warped)


@compiled
def _tones(phase, rates, amplitudes, shifts):
    """Return the sum of amplitude cos(rate phase + shift) over tones and its four derivatives by
    phase, (5, n, 3).

    Args:
        phase: (n,) [rad].
        rates: (H, 3) [1].
        amplitudes: (H, 3).
        shifts: (H, 3) [rad].
    """
    out = np.zeros((5, len(phase), 3))
    for i in range(len(phase)):
        for row in range(len(rates)):
            for axis in range(3):
                rate = rates[row, axis]
                size = amplitudes[row, axis]
                if size != 0.0:
                    angle = rate * phase[i] + shifts[row, axis]
                    cosine = size * math.cos(angle)
                    sine = size * math.sin(angle)
                    out[0, i, axis] += cosine
                    out[1, i, axis] -= rate * sine
                    out[2, i, axis] -= rate**2 * cosine
                    out[3, i, axis] += rate**3 * sine
                    out[4, i, axis] += rate**4 * cosine
    return out
