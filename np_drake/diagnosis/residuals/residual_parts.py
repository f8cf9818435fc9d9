"""Where the held-out residual lies: by channel, kind, time, regime and frequency."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

CHANNELS = ("force x", "force y", "force z", "torque x", "torque y", "torque z")  # body axes
KINDS = {
    "lateral force": ("force x", "force y"),
    "vertical force": ("force z",),
    "torque": ("torque x", "torque y", "torque z"),
}
SHOWN_GAP = 1.05  # residual over noise from which a share of the gap has a meaning [1]; own choice
# residual with the causes over that without, and over noise, from which it grows [1]; own choice
GROWN = 1.1


@dc.dataclass(frozen=True)
class ChannelGap:
    """Held-out residual of one channel of the wrench: RMS before and after, noise floor, share
    explained [1].
    """

    channel: str
    unit: str
    rms: float
    noise_floor: float
    after: float
    explained: float


@dc.dataclass(frozen=True)
class GapKind:
    """Held-out residual of one kind, RMS of its vector: before and after the causes, and of noise
    [unit].

    left: share of the square above the noise that the causes leave [1]; NaN where there is hardly a
    gap.
    above_noise: RMS that is left above the noise [unit].
    """

    kind: str
    unit: str
    before: float
    after: float
    noise: float
    left: float
    above_noise: float

    @property
    def grows(self) -> bool:
        """Whether the causes make it larger."""
        return self.after > GROWN * max(self.before, self.noise)


@dc.dataclass(frozen=True)
class Segment:
    """Part of a flight between two change points, with the RMS residual of each channel in noise
    units.
    """

    flight: str
    start: float
    end: float
    rms: tuple[float, ...]


@dc.dataclass(frozen=True)
class Regime:
    """Rows within a range of one quantity (speed, thrust, height, tilt, rate), with RMS residual in
    noise units.
    """

    quantity: str
    unit: str
    lower: float
    upper: float
    rows: int
    rms: tuple[float, ...]
    rms_after: tuple[float, ...] = ()


@dc.dataclass(frozen=True)
class Band:
    """Spectral density of a channel before, after and of the noise model: frequency (m,) [Hz], the
    others (m,).
    """

    channel: str
    frequency: np.ndarray
    before: np.ndarray
    after: np.ndarray
    noise: np.ndarray


@dc.dataclass(frozen=True)
class Localisation:
    """Localisation of the gap by channel, time, regime and frequency.

    times, before, after: residuals by flight, for figures.
    """

    channels: tuple[ChannelGap, ...]
    segments: tuple[Segment, ...] = ()
    regimes: tuple[Regime, ...] = ()
    bands: tuple[Band, ...] = ()
    times: dict[str, np.ndarray] = dc.field(default_factory=dict)  # flight -> (n,) [s]
    before: dict[str, np.ndarray] = dc.field(default_factory=dict)  # flight -> (n, 6) [N, N·m]
    after: dict[str, np.ndarray] = dc.field(default_factory=dict)


def gap_kinds(every: Sequence[ChannelGap]) -> list[GapKind]:
    """Return the held-out gap of channels by kind, without kinds that the logs do not tell."""
    out = []
    for kind, names in KINDS.items():
        channels = [c for c in every if c.channel in names]
        sizes = [[c.rms, c.after, c.noise_floor] for c in channels]
        before, after, noise = (
            np.sqrt(np.sum(np.square(sizes), axis=0)).tolist() if channels else (0.0, 0.0, 0.0)
        )
        if noise > 0 and before > 0:
            above = max(after**2 - noise**2, 0.0)
            share = above / (before**2 - noise**2) if before > SHOWN_GAP * noise else np.nan
            out.append(GapKind(kind, channels[0].unit, before, after, noise, share, above**0.5))
    return out
