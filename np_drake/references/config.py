"""Configuration of a reference motion, as a part of a scenario file."""

import dataclasses as dc

import numpy as np

from np_drake.references.base import Hover, Reference, Sum
from np_drake.references.harmonic import circle, lemniscate, vertical_lemniscate
from np_drake.references.multisine import Multisine
from np_drake.references.steps import square

TRACKS = ("circle", "lemniscate", "hover", "steps", "vertical")


@dc.dataclass
class ReferenceConfig:
    """Track, size, speed and dither of a reference motion."""

    track: str = "circle"  # circle | lemniscate | hover | steps | vertical
    radius: float = 1.0  # of the circle; from the centre to a corner of the steps' square [m]
    length: float = 1.5  # half length of a lemniscate along x [m]
    width: float = 0.75  # half width of the lemniscate along y [m]
    rise: float = 0.5  # half height of the vertical lemniscate along z [m]
    height: float = 1.6  # [m]
    speed: float = 1.5  # mean speed after the ramp; of the steps: of a move [m/s]
    rest: float = 2.0  # of the steps, at every corner [s]
    ramp: float = 5.0  # from rest to full speed; of the steps: rest before the first move [s]
    dither: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])  # RMS multisine per axis [m]
    dither_frequencies: list[float] = dc.field(  # tones of x; those of y and z lie between them [Hz]
        default_factory=lambda: [0.23, 0.41, 0.67, 0.97]
    )
    dither_seed: int = 0  # of the multisine's phases [1]

    def check(self) -> "ReferenceConfig":
        """Return self after checking track and sizes.

        Raises: ValueError: on an unknown track or an impossible size.
        """
        if self.track not in TRACKS:
            raise ValueError(
                f"ReferenceConfig: track must be one of {', '.join(TRACKS)}; got {self.track!r}."
            )
        for name in ("radius", "length", "width", "rise", "height", "speed"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(
                    f"ReferenceConfig: {name} must be positive and finite; got {getattr(self, name)}."
                )
        if self.track == "vertical" and not self.rise < self.height:
            raise ValueError(
                f"ReferenceConfig: rise must be below height, or the track leads into the ground; got {self.rise}, "
                f"{self.height} [m]."
            )
        for name in ("ramp", "rest"):
            if not 0 <= getattr(self, name) < np.inf:
                raise ValueError(
                    f"ReferenceConfig: {name} must not be negative [s]; got {getattr(self, name)}."
                )
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
    track = _track(config)
    if not np.any(config.dither):
        return track
    dither = Multisine(
        config.dither,
        frequencies=tuple(config.dither_frequencies),
        ramp=max(config.ramp, 1.0),
        seed=config.dither_seed,
    )
    return Sum(track, dither)


def _track(config: ReferenceConfig) -> Reference:
    """Return the track without dither."""
    common = {"height": config.height, "speed": config.speed, "ramp": config.ramp}
    if config.track == "circle":
        return circle(radius=config.radius, **common)
    if config.track == "lemniscate":
        return lemniscate(length=config.length, width=config.width, **common)
    if config.track == "vertical":
        return vertical_lemniscate(length=config.length, rise=config.rise, **common)
    if config.track == "steps":
        return square(radius=config.radius, rest=config.rest, **common)
    return Hover(np.array([0.0, 0.0, config.height]))
