"""Configuration of a reference motion, as a part of a scenario file."""

import dataclasses as dc

import numpy as np

from np_drake.references.base import Hover, Reference, Sum
from np_drake.references.harmonic import Multisine, circle, lemniscate, vertical_lemniscate
from np_drake.references.points import square
from np_drake.references.track_file import CORNERS, ROUND, FileTrack, is_track_file, read_track

FOLLOWED = ("vehicle", "payload")
TRACKS = ("circle", "lemniscate", "hover", "steps", "vertical")


@dc.dataclass
class ReferenceConfig:
    """Track, size, speed and dither of a reference motion."""

    track: str = "circle"  # circle | lemniscate | hover | steps | vertical | a CSV file
    radius: float = 1.0  # of the circle; from the centre to a corner of the steps' square [m]
    length: float = 1.5  # half length of a lemniscate along x [m]
    width: float = 0.75  # half width of the lemniscate along y [m]
    rise: float = 0.5  # half height of the vertical lemniscate along z [m]
    height: float = 1.6  # [m]
    # mean speed after the ramp; of the steps: of a move; of corners `snap`: the largest [m/s]
    speed: float = 1.5
    rest: float = 2.0  # of the steps, and of corners `stop`: at every one [s]
    ramp: float = 5.0  # from rest to full speed; of the steps: rest before the first move [s]
    corners: str = (
        "round"  # of a file's waypoints: round | stop (at rest at each) | snap (the least)
    )
    follow: str = "vehicle"  # whose position the track is: vehicle | payload (of the reality)
    within: float = (
        0.1  # distance from waypoints and their straight legs beyond which a flight warns [m]
    )
    dither: list[float] = dc.field(
        default_factory=lambda: [0.0, 0.0, 0.0]
    )  # RMS multisine per axis [m]
    dither_frequencies: list[float] = (
        dc.field(  # tones of x; those of y and z lie between them [Hz]
            default_factory=lambda: [0.23, 0.41, 0.67, 0.97]
        )
    )
    dither_seed: int = 0  # of the multisine's phases [1]

    def check(self) -> "ReferenceConfig":
        """Return self after checking track and sizes.

        Raises: ValueError: on an unknown track or an impossible size.
        """
        if self.track not in TRACKS and not self.is_file:
            raise ValueError(
                f"ReferenceConfig: track must be one of {', '.join(TRACKS)} or a CSV file; "
                f"got {self.track!r}."
            )
        for name in ("radius", "length", "width", "rise", "height", "speed"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(
                    f"ReferenceConfig: {name} must be positive and finite; got "
                    f"{getattr(self, name)}."
                )
        if self.track == "vertical" and not self.rise < self.height:
            raise ValueError(
                f"ReferenceConfig: rise must be below height, or the track leads into the "
                f"ground; got {self.rise}, "
                f"{self.height} [m]."
            )
        for name in ("ramp", "rest"):
            if not 0 <= getattr(self, name) < np.inf:
                raise ValueError(
                    f"ReferenceConfig: {name} must not be negative [s]; got {getattr(self, name)}."
                )
        if np.shape(self.dither) != (3,) or min(self.dither) < 0:
            raise ValueError(
                f"ReferenceConfig: dither must be three RMS values [m]; got {self.dither}."
            )
        if not self.dither_frequencies or not all(0 < f < np.inf for f in self.dither_frequencies):
            raise ValueError(
                f"ReferenceConfig: dither_frequencies must be positive and finite [Hz]; "
                f"got {self.dither_frequencies}."
            )
        for name, known in (("corners", CORNERS), ("follow", FOLLOWED)):
            if getattr(self, name) not in known:
                got = getattr(self, name)
                raise ValueError(
                    f"ReferenceConfig: {name} must be one of {', '.join(known)}; got {got!r}."
                )
        if not 0 < self.within < np.inf:
            raise ValueError(
                f"ReferenceConfig: within must be positive and finite [m]; got {self.within}."
            )
        if self.is_file:
            self._file()
        elif self.corners != ROUND:
            raise ValueError(
                f"ReferenceConfig: corners is for the waypoints of a CSV file; got "
                f"{self.corners} and {self.track}."
            )
        return self

    @property
    def is_file(self) -> bool:
        """Whether the track is a CSV file's, and not one by name."""
        return is_track_file(self.track)

    @property
    def lead(self) -> float:
        """Time before the scored part [s]: the ramp; of a file's at most its length, none if it
        begins at rest.
        """
        return self._file().lead if self.is_file else self.ramp

    @property
    def own_duration(self) -> float | None:
        """Time from `lead` to the end of a file's track [s]; None for a track without an end."""
        end = self._file().end if self.is_file else np.inf
        return end - self.lead if end < np.inf else None

    @property
    def waypoints(self) -> np.ndarray | None:
        """Points that the track is to pass, (k, 3) [m]; None for a track that is none of points."""
        track = _track(self)
        return getattr(track, "points", getattr(track, "corners", None))

    def _file(self) -> FileTrack:
        return read_track(
            self.track, speed=self.speed, ramp=self.ramp, corners=self.corners, rest=self.rest
        )


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
    if config.is_file:
        return config._file()
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
