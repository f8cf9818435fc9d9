"""Directions of zeta that a flight excites; along the others B would be fitted to noise.

On a plain circle the vertical velocity is noise and feedback; an unguarded fit answers it with 3 N
per m/s, which triples the error off the circle. Directions are the principal axes of zeta over its
noise; B and the encoder see zeta through `shrink`, close to one along excited directions and close
to zero along the others.
"""

import dataclasses as dc

import numpy as np
import scipy

from np_drake.training_data.segments import group_scale, white_noise


def turns(zeta: np.ndarray) -> list[np.ndarray]:
    """Return the eight images of zeta (n, 6) under quarter turns about the vertical and the mirror
    y -> -y.
    """
    quarter, mirror = (
        zeta[:, [1, 0, 2, 4, 3, 5]] * [1, -1, 1, 1, -1, 1],
        np.array([1, -1, 1, -1, 1, -1]),
    )
    half = np.array([-1, -1, 1, -1, -1, 1])
    images = [zeta, quarter, zeta * half, quarter * half]
    return images + [image * mirror for image in images]


CHANNELS = ("vx", "vy", "vz", "wx", "wy", "wz")
AVERAGE = (
    8  # samples averaged before motion is compared with noise: dynamics are slower than noise [1]
)
RELEVANT = 0.01  # motion below this share of the group's (v or omega) counts as noise [1]
THRESHOLD = 4.0  # motion this many times its noise is half trusted [1]


@dc.dataclass(frozen=True)
class Excitation:
    """Excitation of each direction of zeta in a flight.

    noise: (6,) motion too small to learn from: averaged noise of zeta and 1 % of the group's motion
    [m/s,
    rad/s].
    line_share: its share of the motion's power [1]; near 1 for a single circle, which cannot show
        modes at other frequencies.
    """

    noise: np.ndarray
    directions: np.ndarray  # (6, 6) rows of unit length in zeta / noise, strongest first
    deviation: np.ndarray  # (6,) standard deviation of zeta / noise along them; 1 is pure noise
    gain: np.ndarray  # (6,) trust in each direction, 0 … 1
    line_frequency: float  # strongest spectral line [Hz]
    line_share: float

    @property
    def shrink(self) -> np.ndarray:
        """Map from zeta to the part of it that was excited, (6, 6), physical units."""
        N, V = np.diag(self.noise), self.directions
        return N @ (V.T * self.gain) @ V @ np.linalg.inv(N)

    @property
    def text(self) -> str:
        """Summary for people, in one line."""
        weak = self.gain < 0.5
        named = [
            f"{_name(direction)} ({deviation:.1f} x noise)"
            for direction, deviation in zip(
                self.directions[weak], self.deviation[weak], strict=True
            )
        ]
        line = f"{6 - weak.sum()} of 6 directions of zeta excited"
        line += f"; B shrunk along {', '.join(named)}" if named else ""
        if self.line_share > 0.8:
            line += (
                f"; {100 * self.line_share:.0f} % of the motion is one line at "
                f"{self.line_frequency:.2f} Hz"
            )
        return line + "."


def measure_excitation(zeta: list[np.ndarray], *, step: float = 1.0) -> Excitation:
    """Return the excitation of segments zeta (n, 6).

    Args:
        zeta: (n, 6) of each segment [m/s, rad/s].
        step: time between samples [s].
    """
    sigma = np.hypot(
        white_noise(zeta) / np.sqrt(AVERAGE), RELEVANT * group_scale(zeta, centred=True)
    )
    sigma = np.maximum(sigma, 1e-9)
    smooth = np.concatenate(
        [scipy.ndimage.uniform_filter1d(piece, AVERAGE, axis=0) for piece in zeta]
    )
    smooth = (smooth - smooth.mean(axis=0)) / sigma
    # Principal axes of the motion over its noise; variance 1 is pure noise
    variance, vectors = np.linalg.eigh(smooth.T @ smooth / len(smooth))
    variance, directions = np.maximum(variance[::-1], 0.0), vectors.T[::-1]
    signal = np.sqrt(np.maximum(variance - 1.0, 1e-12))
    gain = 1.0 / (1.0 + (THRESHOLD / signal) ** 4)
    frequency, share = _strongest_line(max(zeta, key=len) / sigma, step)
    return Excitation(sigma, directions, np.sqrt(variance), gain, frequency, share)


def _strongest_line(zeta: np.ndarray, step: float) -> tuple[float, float]:
    """Return frequency [Hz] and share of power of the strongest line (three bins, Hann window),
    channels pooled.
    """
    taper = np.hanning(len(zeta))[:, None]
    power = np.sum(np.abs(np.fft.rfft(taper * (zeta - zeta.mean(axis=0)), axis=0)) ** 2, axis=1)
    peak = int(np.argmax(power[1:])) + 1
    share = power[max(peak - 1, 0) : peak + 2].sum() / max(power.sum(), 1e-300)
    return float(np.fft.rfftfreq(len(zeta), step)[peak]), float(share)


def _name(direction: np.ndarray) -> str:
    """Return the names of the channels that make up nine tenths of a direction, strongest first."""
    order = np.argsort(-(direction**2))
    count = int(np.searchsorted(np.cumsum(direction[order] ** 2), 0.9)) + 1
    return " & ".join(CHANNELS[i] for i in order[:count])
