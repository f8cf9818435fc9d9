"""Naive manoeuvres of a given length, each as large or as fast as the limits allow."""

from collections.abc import Callable

import numpy as np

from np_drake.flight_design.limits import Limits, largest
from np_drake.flight_design.motion import DOUBLET, POINTS, TONES, Basis, DesignedMotion
from np_drake.references.base import Hover, Reference
from np_drake.references.harmonic import HarmonicTrack
from np_drake.references.ramp import compose, ramped_phase

NAIVE = ("hover", "circle", "lemniscate", "random", "doublets")
RAMP = 0.2  # from rest to full rate, over the duration [1]
FILL = 0.8  # of the room, in which a circle or lemniscate lies [1]
FAST = 2.0  # from which tones are limited by torque [Hz]; own choice
ACROSS = 15.0  # largest acceleration of the widest move of a doublet, over size / duration² [1]
RATE = 50.0  # at which the limits are looked at [Hz]


class Laps:
    """Harmonic track at constant phase rate, from rest to rest within `duration` [s]; rate: [rad/s]."""

    def __init__(self, track: HarmonicTrack, rate: float, duration: float):
        self.track, self.rate, self.end = track, rate, duration

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        ramp, t = RAMP * self.end, np.clip(t, 0.0, self.end)
        phase = ramped_phase(t, self.rate, ramp) - ramped_phase(t - (self.end - ramp), self.rate, ramp)
        return compose(self.track.path(phase[0]), phase)


def naive_motions(limits: Limits, basis: Basis, share: float, seed: int) -> dict[str, Reference]:
    """Return the naive manoeuvres by name.

    Args:
        limits: of the flight.
        basis: of which `random` is a draw; its duration is that of all.
        share: of the limits that may be used [1].
        seed: of the draw.
    """
    t = np.linspace(0.0, basis.duration, round(basis.duration * RATE) + 1)

    def sized(make: Callable[[float], Reference]) -> Reference:
        """Return the largest motion within the limits of those that `make` makes."""

        def used(size: float) -> float:
            return max(limits.usage(t, make(size).sample(t)).values())

        return make(largest(used, 0.5, share))

    rng, center = np.random.default_rng(seed), limits.center
    draw = random_coefficients(rng, basis, limits)
    x, y, _ = FILL * share * limits.half
    radius = min(x, y)
    tracks = {
        "circle": ([[radius, radius, 0.0]], [[0.0, -np.pi / 2, 0.0]]),
        "lemniscate": ([[x, 0.0, 0.0], [0.0, y, 0.0]], [[0.0, 0.0, 0.0], [0.0, -np.pi / 2, 0.0]]),
    }
    laps = {name: HarmonicTrack(center, *track, speed=1.0, ramp=0.0) for name, track in tracks.items()}
    found: dict[str, Reference] = {"hover": Hover(center)}
    for name, track in laps.items():
        found[name] = sized(lambda rate, track=track: Laps(track, rate, basis.duration))  # type: ignore[misc]
    found["random"] = sized(lambda size: DesignedMotion(basis, center, size * draw))
    found["doublets"] = sized(lambda size: DesignedMotion(basis, center, size * doublets(basis)))
    return found


def doublets(basis: Basis) -> np.ndarray:
    """Return the coefficients (q, 3) of doublets of 1 m along x, y and z in turn."""
    found = np.zeros((basis.size, 3))
    for k in range(basis.doublets):
        found[basis.size - basis.doublets + k, k % 3] = 1.0
    return found


def random_coefficients(rng: np.random.Generator, basis: Basis, limits: Limits) -> np.ndarray:
    """Return random coefficients (q, 3): splines, tones and doublets, mixed at random on each axis."""
    scale = coefficient_scale(basis, limits)
    mixture = np.exp(rng.normal(scale=1.0, size=(basis.size, 1)))
    axes = np.exp(rng.normal(scale=0.5, size=(1, 3)))
    return scale * mixture * axes * rng.standard_normal((basis.size, 3))


def coefficient_scale(basis: Basis, limits: Limits) -> np.ndarray:
    """Return the natural size (q, 3) of coefficients.

    Half the room for splines; for tones a sixth of the largest lean, less where torque limits; for doublets the same.
    """
    push = limits.vehicle.gravity * np.tan(limits.tilt) / 6
    tones = push * np.repeat(np.minimum(1.0, (FAST / np.array(TONES)) ** 2), 2)
    moves = np.full(basis.doublets, push * DOUBLET**2 / ACROSS)
    fast = np.tile(np.concatenate([tones, moves])[:, None], (1, 3))
    return np.concatenate([np.tile(0.5 * limits.half, (POINTS, 1)), fast])
