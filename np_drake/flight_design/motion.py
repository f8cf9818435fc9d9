"""Motions of a design: spline points, tones and doublets on each axis, from rest to rest, linear in coefficients."""

import dataclasses as dc
from functools import cached_property
from math import comb

import numpy as np

from np_drake.references.base import Reference
from np_drake.references.ramp import rest_to_rest
from np_drake.references.spline import Spline

POINTS = 9  # of the spline, between its ends
TONES = (0.3, 0.5, 0.8, 1.2, 1.7, 2.3)  # that controllers of position follow [Hz]; own choice
DOUBLET = 0.9  # of a move of a doublet [s]
START = 0.5  # of the first doublet [s]
FADE = 2.0  # in which tones fade in and out [s]


@dc.dataclass(frozen=True)
class Basis:
    """Motions of one axis over `duration` [s]: q of them, each at rest with three derivatives zero at both ends.

    `POINTS` splines, each 1 m at one of equally spaced times and 0 at the others; a sine and a cosine of each tone,
    whose acceleration has the amplitude 1 m/s²; doublets, one after the other, each 1 m out, across and back.

    step: of the times [s].
    """

    duration: float
    step: float

    @property
    def size(self) -> int:
        """Number of motions."""
        return POINTS + 2 * len(TONES) + self.doublets

    @property
    def doublets(self) -> int:
        """Number of doublets that follow each other."""
        return max(1, int((self.duration - 2 * START) / (3 * DOUBLET)))

    @cached_property
    def blocks(self) -> np.ndarray:
        """(q,) number of the block that a motion belongs to: splines, a tone, or doublets."""
        tones = np.repeat(np.arange(len(TONES)), 2)
        ends = np.zeros(POINTS, int), 1 + tones, np.full(self.doublets, 1 + len(TONES))
        return np.concatenate(ends)

    @cached_property
    def t(self) -> np.ndarray:
        """(n,) times [s]."""
        return self.step * np.arange(round(self.duration / self.step) + 1)

    @cached_property
    def flat(self) -> np.ndarray:
        """(5, n, q) the motions and their four derivatives at `t` [m, m/s, …]."""
        return self.at(self.t)

    def at(self, t: np.ndarray) -> np.ndarray:
        """Return the motions and their four derivatives at times t (n,), (5, n, q)."""
        return np.concatenate([self._splines(t), self._tones(t), self._doublets(t)], axis=2)

    def _splines(self, t: np.ndarray) -> np.ndarray:
        times = np.linspace(0.0, self.duration, POINTS + 2)
        points = np.zeros((POINTS + 2, 3 * -(-POINTS // 3)))
        points[1:-1, :POINTS] = np.eye(POINTS)
        groups = np.split(points, points.shape[1] // 3, axis=1)
        return np.concatenate([Spline(group, times).sample(t) for group in groups], axis=2)[..., :POINTS]

    def _doublets(self, t: np.ndarray) -> np.ndarray:
        length = DOUBLET * min(1.0, (self.duration - 2 * START) / (3 * DOUBLET))
        found = []
        for k in range(self.doublets):
            begin = START + 3 * k * length
            moves = [way * _step(t - begin - i * length, length) for i, way in enumerate((1.0, -2.0, 1.0))]
            found.append(sum(moves))
        return np.stack(found, axis=2)

    def _tones(self, t: np.ndarray) -> np.ndarray:
        fade = min(FADE, 0.4 * self.duration)
        up = _step(t, fade)
        down = _step(self.duration - t, fade) * (-1.0) ** np.arange(5)[:, None]
        window = _product(up, down)
        angle = 2 * np.pi * np.outer(t, TONES)
        rate = 2 * np.pi * np.array(TONES)
        shift = np.array([0.0, 0.5 * np.pi])[:, None, None]
        tones = np.stack([rate ** (k - 2) * np.sin(angle + shift + 0.5 * k * np.pi) for k in range(5)])
        both = tones.transpose(0, 2, 1, 3).reshape(5, len(t), -1)
        return _product(window[..., None], both)


def _step(t: np.ndarray, duration: float) -> np.ndarray:
    """Return a step from 0 to 1 over `duration` [s] and its four derivatives, (5, n), which are zero outside."""
    step = rest_to_rest(t / duration, duration)
    step[1:, (t <= 0.0) | (t >= duration)] = 0.0
    return step


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the derivatives of a product from those of its factors, (5, ...) (Leibniz)."""
    return np.stack([sum(comb(k, i) * a[i] * b[k - i] for i in range(k + 1)) for k in range(5)])


class DesignedMotion:
    """Motion of a design as a reference: coefficients (q, 3) of a basis about `center` (3,) [m], at rest outside."""

    def __init__(self, basis: Basis, center: np.ndarray, coefficients: np.ndarray):
        self.basis, self.center, self.coefficients = basis, center, coefficients
        self.end = basis.duration

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        inside = np.clip(t, 0.0, self.end)
        flat = self.basis.at(inside) @ self.coefficients
        flat[0] += self.center
        flat[1:, (t < 0.0) | (t > self.end)] = 0.0
        return flat

    @property
    def flat(self) -> np.ndarray:
        """(5, n, 3) p and its four derivatives in W at the times of the basis."""
        flat = self.basis.flat @ self.coefficients
        flat[0] += self.center
        return flat


class Shrunk:
    """Reference motion shrunk about `center` (3,) [m] by `factor` [1]."""

    def __init__(self, reference: Reference, center: np.ndarray, factor: float):
        self.reference, self.center, self.factor = reference, center, factor

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        flat = self.factor * self.reference.sample(t)
        flat[0] += (1.0 - self.factor) * self.center
        return flat
