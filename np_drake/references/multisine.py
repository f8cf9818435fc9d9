"""Multisine dither that makes a training flight excite every direction of zeta."""

import numpy as np

from np_drake.references.ramp import compose, ramped_phase


class Multisine:
    """Sum of sines at incommensurate frequencies in each axis, faded in with the ramp by its phase.

    All tones of an axis have the same velocity amplitude, and their sum has the RMS given (about its own mean; it
    starts at zero offset). Source: own choice: training on a circle without dither yields a spurious force per vz.

    Args:
        amplitude: (3,) RMS of the dither per axis [m].   frequencies: of the tones of x [Hz]; y and z take tones
        between them, so that no two axes share one.   ramp: [s].   seed: of the tones' phases.
    """

    def __init__(self, amplitude, *, frequencies=(0.23, 0.41, 0.67, 0.97), ramp: float = 5.0, seed: int = 0):
        self.frequencies = np.array(frequencies)[:, None] * np.array([1.0, 1.13, 1.27])
        share = 1 / self.frequencies
        self.amplitude = np.array(amplitude, float) * share / np.sqrt(0.5 * np.sum(share**2, axis=0))
        self.shift = np.random.default_rng(seed).uniform(0, 2 * np.pi, share.shape)
        self.ramp = ramp

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]; starts at rest at zero offset."""
        warped = ramped_phase(t, 1.0, self.ramp)
        path = np.zeros((5, len(t), 3))
        for f, amplitude, shift in zip(self.frequencies, self.amplitude, self.shift, strict=True):
            omega = 2 * np.pi * f
            angle = omega * warped[0][:, None] + shift
            path[0] += amplitude * (np.sin(angle) - np.sin(shift))
            for k in range(1, 5):
                path[k] += amplitude * omega**k * np.sin(angle + k * np.pi / 2)
        return compose(path, warped)
