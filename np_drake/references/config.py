"""Configuration of a reference motion, as a part of a scenario file."""

import dataclasses as dc

import numpy as np

from np_drake.references.base import Hover, Reference, Sum
from np_drake.references.harmonic import circle, lemniscate
from np_drake.references.multisine import Multisine


@dc.dataclass
class ReferenceConfig:
    """Track, size, speed and dither of a reference motion."""

    track: str = "circle"  # circle | lemniscate | hover
    radius: float = 1.0  # of the circle [m]
    length: float = 1.5  # half length of the lemniscate along x [m]
    width: float = 0.75  # half width of the lemniscate along y [m]
    height: float = 1.6  # [m]
    speed: float = 1.5  # mean speed after the ramp [m/s]
    ramp: float = 5.0  # from rest to full speed [s]
    dither: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])  # RMS multisine per axis [m]
    dither_frequencies: list[float] = dc.field(  # tones of x; those of y and z lie between them [Hz]
        default_factory=lambda: [0.23, 0.41, 0.67, 0.97]
    )
    dither_seed: int = 0  # of the multisine's phases [1]

    def check(self) -> "ReferenceConfig":
        """Return self after checking track and sizes.

        Raises: ValueError: on an unknown track or an impossible size.
        """
        if self.track not in ("circle", "lemniscate", "hover"):
            raise ValueError(
                f"ReferenceConfig: track must be circle, lemniscate or hover; got {self.track!r}."
            )
        for name in ("radius", "length", "width", "height", "speed"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(
                    f"ReferenceConfig: {name} must be positive and finite; got {getattr(self, name)}."
                )
        if not 0 <= self.ramp < np.inf:
            raise ValueError(f"ReferenceConfig: ramp must not be negative [s]; got {self.ramp}.")
        if np.shape(self.dither) != (3,) or min(self.dither) < 0:
            raise ValueError(f"ReferenceConfig: dither must be three RMS values [m]; got {self.dither}.")
        if not self.dither_frequencies or not all(0 < f < np.inf for f in self.dither_frequencies):
            raise ValueError(
                f"ReferenceConfig: dither_frequencies must be positive and finite [Hz]; got {self.dither_frequencies}."
            )
        return self


def make_reference(config: ReferenceConfig) -> Reference:
    """Return the reference motion that `config` describes."""
    config.check()
    common = {"height": config.height, "speed": config.speed, "ramp": config.ramp}
    track: Reference
    if config.track == "circle":
        track = circle(radius=config.radius, **common)
    elif config.track == "lemniscate":
        track = lemniscate(length=config.length, width=config.width, **common)
    else:
        track = Hover(np.array([0.0, 0.0, config.height]))
    if not np.any(config.dither):
        return track
    dither = Multisine(
        config.dither,
        frequencies=tuple(config.dither_frequencies),
        ramp=max(config.ramp, 1.0),
        seed=config.dither_seed,
    )
    return Sum(track, dither)
