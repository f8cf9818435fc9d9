"""The answer of a diagnosis as dataclasses; `as_json` is the file `diagnosis.json` (docs/reference/files.md)."""

import dataclasses as dc
from collections.abc import Callable
from typing import Any

import numpy as np

from np_drake.effects.base import Effect
from np_drake.logs.flight_log import FlightLog

CHANNELS = ("force x", "force y", "force z", "torque x", "torque y", "torque z")  # body axes
HORIZONS = (0.1, 0.25, 0.5, 1.0)  # of the replay [s]
UNKNOWN = "unknown"


@dc.dataclass(frozen=True)
class Estimate:
    """A parameter with its unit and 95 % interval."""

    value: float
    unit: str
    ci95: tuple[float, float]


@dc.dataclass(frozen=True)
class Cause:
    """One unmodelled effect that the logs show.

    onset: by flight, the time at which it begins [s]; None where it acts from the start (or not at all: absent).
    share: square of its own trace over that of the gap above the noise, in the flights of the fit [1]; NaN for gusts,
        which have none there. Traces overlap: shares need not add up.   effect: the fitted object.
    """

    identifier: str
    probability: float
    parameters: dict[str, Estimate]
    onset: dict[str, float | None]
    indistinguishable_from: tuple[str, ...] = ()
    share: float = float("nan")
    effect: Effect | None = None


@dc.dataclass(frozen=True)
class Finding:
    """Something worth a line: a minor (significant but immaterial) effect, or a trace of what is unknown."""

    name: str
    text: str
    size: float  # share of the gap above the noise [1], or what the text says
    figures: dict[str, float] = dc.field(default_factory=dict)


@dc.dataclass(frozen=True)
class ChannelGap:
    """One channel of the residual wrench, held-out: RMS before and after, noise floor, share explained [1]."""

    channel: str
    unit: str
    rms: float
    noise_floor: float
    after: float
    explained: float


@dc.dataclass(frozen=True)
class Segment:
    """A stretch of a flight between two change points, with the RMS residual of each channel in noise units."""

    flight: str
    start: float
    end: float
    rms: tuple[float, ...]


@dc.dataclass(frozen=True)
class Regime:
    """Rows alike in one quantity (speed, thrust, height, tilt, rate), with RMS residual in noise units."""

    quantity: str
    unit: str
    lower: float
    upper: float
    rows: int
    rms: tuple[float, ...]
    rms_after: tuple[float, ...] = ()


@dc.dataclass(frozen=True)
class Band:
    """Spectral density of a channel before, after and of the noise model: frequency (m,) [Hz], the others (m,)."""

    channel: str
    frequency: np.ndarray
    before: np.ndarray
    after: np.ndarray
    noise: np.ndarray


@dc.dataclass(frozen=True)
class Where:
    """Step 2: channels, time, regime, frequency. `times`, `before`, `after`: residual traces by flight, for figures."""

    channels: tuple[ChannelGap, ...]
    segments: tuple[Segment, ...] = ()
    regimes: tuple[Regime, ...] = ()
    bands: tuple[Band, ...] = ()
    times: dict[str, np.ndarray] = dc.field(default_factory=dict)  # flight -> (n,) [s]
    before: dict[str, np.ndarray] = dc.field(default_factory=dict)  # flight -> (n, 6) [N, N·m]
    after: dict[str, np.ndarray] = dc.field(default_factory=dict)


@dc.dataclass(frozen=True)
class Confusable:
    """Effects that these logs cannot tell apart, or not see at all, and the manoeuvre that would."""

    effects: tuple[str, ...]
    because: str
    manoeuvre: str


@dc.dataclass(frozen=True)
class Check:
    """Step 1: is the log usable, what can it not tell?   excitation: by quantity, RMS or span with unit in the key."""

    usable: bool
    excitation: dict[str, float]
    noise_floor: dict[str, float]  # by channel [N, N·m]
    not_identifiable: tuple[Confusable, ...]
    warnings: tuple[str, ...] = ()


@dc.dataclass(frozen=True)
class Rung:
    """A rung of the ladder: pooled held-out residual in noise units once the effects so far are added."""

    name: str
    residual: float


@dc.dataclass(frozen=True)
class ReplayGap:
    """Error of open-loop replay against horizon: median over starts and the 95 % interval of the median.

    horizon (h,) [s]; position [m], velocity [m/s], attitude [deg]: (h, 3) = value, lower, upper.
    """

    horizon: tuple[float, ...]
    position: np.ndarray
    velocity: np.ndarray
    attitude: np.ndarray
    starts: int


@dc.dataclass(frozen=True)
class Shrink:
    """Step 4: held-out residual in noise units before and after;

    fraction = 1 - (after² - floor²) / (before² - floor²).
    """

    before: float
    after: float
    floor: float
    fraction: float
    ci95: tuple[float, float]
    ladder: tuple[Rung, ...]
    replay_before: ReplayGap | None = None
    replay_after: ReplayGap | None = None
    warnings: tuple[str, ...] = ()


@dc.dataclass(frozen=True)
class Diagnosis:
    """All five steps. verdict: identifiers, possibly with `unknown`; empty: nothing is missing.

    joined: held-out flights whose first half joined the fit, so that only their second half judges.
    cannot_tell: the logs excite nothing; then there is no verdict.   unknown: probability that something material
    is left that no effect of the library explains.   judged_as: logs of a rig or of a laboratory; empty: neither.
    """

    vehicle: str
    train: tuple[str, ...]
    held_out: tuple[str, ...]
    verdict: tuple[str, ...]
    causes: tuple[Cause, ...]
    check: Check
    where: Where
    shrink: Shrink
    minor: tuple[Finding, ...] = ()
    remains: tuple[Finding, ...] = ()
    unknown_probability: float = 0.0
    cannot_tell: bool = False
    warnings: tuple[str, ...] = ()
    wall: float = float("nan")  # [s]
    joined: tuple[str, ...] = ()
    judged_as: str = ""

    def as_json(self) -> dict[str, Any]:
        """`diagnosis.json` as a dictionary of plain types."""
        from np_drake.diagnosis.answer_json import as_json

        return as_json(self)


Replay = Callable[[list[FlightLog], list[tuple[Effect, dict[str, float | None]]]], ReplayGap]
"""(held-out logs, effects with their onset by flight) -> error of the simulator with these effects; [] is nominal.

Times of logs and onsets count from the flight's first row.
"""
