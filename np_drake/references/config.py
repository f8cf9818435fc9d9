"""Configuration of a reference motion, as a part of a scenario file."""

import dataclasses as dc

import numpy as np

from np_drake.checks import require
from np_drake.files.yaml_file import POSITIVE, check_fields, number, word
from np_drake.references.base import Hover, Reference, Sum
from np_drake.references.harmonic import Multisine, circle, lemniscate, vertical_lemniscate
from np_drake.references.track_file import CORNERS, ROUND, SUFFIXES, FileTrack, read_track
from np_drake.references.waypoints import square

TRACKS = ("circle", "lemniscate", "hover", "steps", "vertical", "multisine")
TONES = 8  # of the multisine, over its band


@dc.dataclass
class ReferenceConfig:
    """Track, size, speed and dither of a reference motion."""

    # circle | lemniscate | hover | steps | vertical | multisine, or a CSV file
    track: str = "circle"
    # of the circle; from the centre to a corner of the steps' square [m]
    radius: float = number(1.0, "m", POSITIVE)
    length: float = number(1.5, "m", POSITIVE)  # half length of a lemniscate along x
    width: float = number(0.75, "m", POSITIVE)  # half width of the lemniscate along y
    rise: float = number(0.5, "m", POSITIVE)  # half height of `vertical`, below `height`
    height: float = number(1.6, "m", POSITIVE)  # above the ground
    # mean speed after the ramp; of the steps: of a move
    speed: float = number(1.5, "m/s", POSITIVE)
    rest: float = number(2.0, "s", 0.0)  # of the steps, and of corners `stop`: at every one
    ramp: float = number(5.0, "s", 0.0)  # to full speed, not scored; of the steps: first rest
    amplitude: list[float] = number([0.4, 0.4, 0.15], "m", 0.0)  # RMS of the multisine on each axis
    band: list[float] = number([0.1, 0.8], "Hz", POSITIVE)  # its lowest and highest tone on x
    seed: int = number(0, "1", 0)  # of its phases
    corners: str = word(ROUND, *CORNERS)  # of a file's waypoints: rounded off, or a stop
    # distance from waypoints beyond which a flight warns
    within: float = number(0.1, "m", POSITIVE)
    # RMS of a multisine on each axis, which excites all directions of zeta
    dither: list[float] = number([0.0, 0.0, 0.0], "m", 0.0)
    # tones of x; those of y and z lie between them [Hz]
    dither_frequencies: list[float] = dc.field(default_factory=lambda: [0.23, 0.41, 0.67, 0.97])
    dither_seed: int = number(0, "1", 0)  # of the dither's phases

    def __post_init__(self) -> None:
        """Raises: ValueError: where a number is outside its bounds."""
        check_fields(self, "ReferenceConfig")

    def check(self) -> "ReferenceConfig":
        """Return self after checking track and sizes.

        Raises: ValueError: on an unknown track or an impossible size.
        """
        check_fields(self, "ReferenceConfig")
        require(
            self.track in TRACKS or self.is_file,
            f"ReferenceConfig: track must be one of {', '.join(TRACKS)} or a CSV file; got "
            f"{self.track!r}.",
        )
        require(
            self.track != "vertical" or self.rise < self.height,
            "ReferenceConfig: rise must be below height, or the track leads into the ground; got "
            f"{self.rise}, {self.height} [m].",
        )
        require(
            self.band[0] < self.band[1],
            f"ReferenceConfig: band must be a lower and a higher frequency; got {self.band}.",
        )
        require(
            self.dither_frequencies and all(0 < f < np.inf for f in self.dither_frequencies),
            "ReferenceConfig: dither_frequencies must be positive and finite [Hz]; got "
            f"{self.dither_frequencies}.",
        )
        if self.is_file:
            self._file()
        require(
            self.is_file or self.corners == ROUND,
            f"ReferenceConfig: corners is for the waypoints of a CSV file; got {self.corners} and "
            f"{self.track}.",
        )
        return self

    @property
    def is_file(self) -> bool:
        """Whether the track is a CSV file's, and not one by name."""
        return self.track.lower().endswith(SUFFIXES)

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
    tones = tuple(config.dither_frequencies)
    ramp = max(config.ramp, 1.0)
    return Sum(track, Multisine(config.dither, tones, ramp=ramp, seed=config.dither_seed))


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
    hover = Hover(np.array([0.0, 0.0, config.height]))
    if config.track == "hover":
        return hover
    tones = np.geomspace(config.band[0], config.band[1], TONES)
    ramp = max(config.ramp, 1.0)
    return Sum(hover, Multisine(config.amplitude, tones, ramp=ramp, seed=config.seed))
