"""Result of a diagnosis as dataclasses; `as_json` gives the file `diagnosis.json`
(docs/reference/files.md).
"""

import dataclasses as dc
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np

from np_drake.effects.base import Effect
from np_drake.effects.effect_entry import Posterior
from np_drake.files.file_access import plain
from np_drake.files.notebook import html_table
from np_drake.files.number_text import probability
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle
from np_drake.vehicle.rotor_layout import RotorName

CHANNELS = ("force x", "force y", "force z", "torque x", "torque y", "torque z")  # body axes
KINDS = {
    "lateral force": ("force x", "force y"),
    "vertical force": ("force z",),
    "torque": ("torque x", "torque y", "torque z"),
}
SHOWN_GAP = 1.05  # residual over noise from which a share of the gap has a meaning [1]; own choice


@dc.dataclass(frozen=True)
class ChannelGap:
    """Held-out residual of one channel of the wrench: RMS before and after, and noise floor."""

    channel: str
    unit: str
    rms: float
    noise_floor: float
    after: float


@dc.dataclass(frozen=True)
class GapKind:
    """Held-out residual of one kind, RMS of its vector: before and after the causes, and of noise
    [unit].

    remaining: share of the square above the noise that the causes leave [1]; NaN where there is
    hardly a gap.
    above_noise: RMS that is left above the noise [unit].
    """

    kind: str
    unit: str
    before: float
    after: float
    noise: float
    remaining: float
    above_noise: float


@dc.dataclass(frozen=True)
class Regime:
    """Residual in a range of a quantity: RMS by channel in noise units, before and after."""

    quantity: str
    unit: str
    lower: float
    upper: float
    rows: int
    rms: tuple[float, ...]
    rms_after: tuple[float, ...]


@dc.dataclass(frozen=True)
class Localisation:
    """Localisation of the gap by channel, time and regime.

    times, before, after: residuals by flight, for studies and the corrected simulator.
    """

    channels: tuple[ChannelGap, ...]
    regimes: tuple[Regime, ...] = ()
    times: dict[str, np.ndarray] = dc.field(default_factory=dict)  # flight -> (n,) [s]
    before: dict[str, np.ndarray] = dc.field(default_factory=dict)  # flight -> (n, 6) [N, N·m]
    after: dict[str, np.ndarray] = dc.field(default_factory=dict)


def gap_kinds(channel_gaps: Sequence[ChannelGap]) -> list[GapKind]:
    """Return the held-out gap of channels by kind, without kinds that the logs do not tell."""
    out = []
    for kind, names in KINDS.items():
        channels = [c for c in channel_gaps if c.channel in names]
        sizes = [[c.rms, c.after, c.noise_floor] for c in channels]
        before, after, noise = (
            np.sqrt(np.sum(np.square(sizes), axis=0)).tolist() if channels else (0.0, 0.0, 0.0)
        )
        if noise > 0 and before > 0:
            above = max(after**2 - noise**2, 0.0)
            share = above / (before**2 - noise**2) if before > SHOWN_GAP * noise else np.nan
            out.append(GapKind(kind, channels[0].unit, before, after, noise, share, above**0.5))
    return out


HORIZONS = (0.1, 0.25, 0.5, 1.0)  # horizons of the replay [s]
SCHEMA = "np_drake.diagnosis/1"
UNKNOWN = "unknown"


@dc.dataclass(frozen=True)
class Estimate:
    """Value of a parameter with its unit and 95 % interval."""

    value: float
    unit: str
    ci95: tuple[float, float]

    @property
    def half(self) -> float:
        """Half of the interval's width."""
        return 0.5 * (self.ci95[1] - self.ci95[0])


@dc.dataclass(frozen=True)
class Cause:
    """Unmodelled effect that the logs show.

    onset: by flight, the time at which it begins [s]; None: from the start; infinite: absent from
    the flight.
    share: power of its own predicted residual over that of the gap above the noise, in the flights
        of the fit [1]; NaN for gusts, which have none there. Predicted residuals overlap, so that
        shares need not add up to one.
    effect: the fitted object.
    changed: it acts in none of the flights from before what is asked.
    held_out_gain: share of the held-out gap above the noise that comes back without it [1];
        negative: flights contradict it.
    rotor: what its rotor is called; None: it has none.
    loads: a payload's mass after each of its changes [kg]; 0: it is gone.
    changes: by flight, the times of these [s]; infinite: not there.
    """

    identifier: str
    probability: float
    parameters: dict[str, Estimate]
    onset: dict[str, float | None]
    indistinguishable_from: tuple[str, ...] = ()
    share: float = float("nan")
    effect: Effect | None = None
    held_out_gain: float = float("nan")
    changed: bool = False
    rotor: RotorName | None = None
    loads: tuple[Estimate, ...] = ()
    changes: dict[str, tuple[float, ...]] = dc.field(default_factory=dict)

    def steps(self, flight: str) -> list[tuple[float, Estimate]]:
        """Return the changes of a payload in a flight: time [s], mass from then on [kg]."""
        both = zip(self.changes.get(flight, ()), self.loads, strict=False)
        return [(t, load) for t, load in both if t != np.inf]

    @property
    def later(self) -> list[Effect]:
        """The payload after each of its changes, in the form of `effect`."""
        if self.effect is None or not self.loads:
            return []
        share = self.effect.values["mass"] / self.parameters["mass"].value
        return [dc.replace(self.effect, mass=share * load.value) for load in self.loads]  # type: ignore[type-var]


@dc.dataclass(frozen=True)
class Difference:
    """What a vehicle differs by from its file, or a flight from others of its vehicle: calibration,
    and no cause.

    value: departure from the file [unit], in the flight that the text names.
    deviation: of healthy vehicles [unit]. by_flight: value in every flight of the fit; empty: the
        same in all.
    """

    name: str
    text: str
    value: float
    unit: str
    deviation: float
    ci95: tuple[float, float] = (float("nan"), float("nan"))
    by_flight: dict[str, float] = dc.field(default_factory=dict)

    @property
    def in_deviations(self) -> float:
        """Size over the standard deviation of healthy vehicles [1]."""
        return abs(self.value) / self.deviation if self.deviation > 0 else 0.0


@dc.dataclass(frozen=True)
class ResidualFinding:
    """Result that is no cause: a significant but immaterial effect, or a sign of unknown structure.

    measurement: the one flight or measurement that would end it; empty: none is needed.
    """

    name: str
    text: str
    size: float  # share of the gap above the noise [1], or what the text says
    figures: dict[str, float] = dc.field(default_factory=dict)
    measurement: str = ""


@dc.dataclass(frozen=True)
class Identifiability:
    """Whether the logs are usable, and what they excite.

    excitation: by quantity, an RMS or span, with the unit in the key.
    """

    usable: bool
    excitation: dict[str, float]
    noise_floor: dict[str, float]  # by channel [N, N·m]
    warnings: tuple[str, ...] = ()


@dc.dataclass(frozen=True)
class ReplayGap:
    """Error of open-loop replay against horizon: median over starts and its 95 % interval.

    horizon (h,) [s]; position [m], velocity [m/s], attitude [deg]: (h, 3) = value, lower, upper.
    """

    horizon: tuple[float, ...]
    position: np.ndarray
    velocity: np.ndarray
    attitude: np.ndarray
    starts: int

    def medians(self) -> dict[str, list[float]]:
        """Return the medians (h,) of position [m], velocity [m/s] and attitude [deg]."""
        return {name: of[:, 0].tolist() for name, of in self._quantities().items()}

    def intervals(self) -> dict[str, list[list[float]]]:
        """Return the 95 % intervals (h, 2) of the same."""
        return {f"{name}_ci95": of[:, 1:].tolist() for name, of in self._quantities().items()}

    def _quantities(self) -> dict[str, np.ndarray]:
        return {"position": self.position, "velocity": self.velocity, "attitude_deg": self.attitude}


@dc.dataclass(frozen=True)
class Remainder:
    """What causes and calibration leave of the held-out gap beyond the noise.

    share: of the gap [1], the median of its posterior, and its 95 % interval; NaN where the gap is
    immaterial.
    force [N], torque [N·m]: RMS.
    position: error that they cause in a simulator after 1 s, RMS, NaN where noise hides it [m].
    position_before: the same of the gap [m].
    probability: that it is material [1].
    noise: position error that noise alone does not exceed in 95 % of the starts [m].
    """

    share: float = float("nan")
    ci95: tuple[float, float] = (float("nan"), float("nan"))
    force: float = 0.0
    torque: float = 0.0
    position: float = 0.0
    position_before: float = 0.0
    probability: float = 0.0
    noise: float = 0.0

    @property
    def matters(self) -> bool:
        """Whether it is probably material."""
        return self.probability >= 0.5


@dc.dataclass(frozen=True)
class GapReduction:
    """Held-out residual in noise units before and after the causes are added; remainder: what they
    leave of the gap.
    """

    before: float
    after: float
    remainder: Remainder = Remainder()
    replay_before: ReplayGap | None = None
    replay_after: ReplayGap | None = None
    warnings: tuple[str, ...] = ()
    floor: ClassVar[float] = 1.0

    @property
    def material(self) -> bool:
        """Whether there is a material gap, of which a share can be closed."""
        return self.remainder.share == self.remainder.share

    @property
    def fraction(self) -> float:
        """Share of the gap beyond the noise that causes and calibration close [1], at least -1; 0
        where the gap is immaterial.
        """
        return max(1.0 - self.remainder.share, -1.0) if self.material else 0.0

    @property
    def ci95(self) -> tuple[float, float]:
        """95 % interval of `fraction`."""
        low, high = self.remainder.ci95 if self.material else (1.0, 1.0)
        return max(1.0 - high, -1.0), max(1.0 - low, -1.0)


@dc.dataclass(frozen=True, repr=False)
class Diagnosis:
    """Result of all five steps of a diagnosis.

    verdict: identifiers of effects, possibly with `unknown`; empty: nothing is missing.
    joined: held-out flights whose first half joined the fit, so that held-out figures are of their
        second half alone (adaptive split).
    cannot_tell: the logs excite nothing, and there is no verdict.
    below_threshold: effects of the best model that are immaterial or not probable enough for a
        cause.
    unexplained: signs of structure that no effect of the library explains.
    unknown_probability: probability that a material residual remains that no effect of the library
        explains [1].
    refit: second answer, with the first halves of held-out flights in its fit, where these show
        more than the others.
    new_on_held_out: what held-out flights show that the training flights do not.
    judged_as: tolerance used: `rig` (real sensors) or `laboratory` (ideal sensors); empty: neither.
    posterior: joint, of the parameters of the causes.
    doubts: what stands against any answer from these flights, as `np-drake doctor` finds it; said
        before the answer.
    not_flyable: why no plain controller flies the corrected simulator, and what to do; empty: one
        does, or none tried.
    calibration: by what an unmeasured vehicle and its flights differ, largest first; empty: the
        file describes it.
    headline: the answer in one sentence (`report.words.headline`).
    before: flights from before what is asked; the verdict is then what changed since.
    visible: by effect and parameter, the smallest change since then that would be named as often as
        not [SI].
    rotors: what the rotors of the vehicle are called.
    nominal: vehicle that was judged, that of the file unless a guess in it gave way; None: read
        from a report.
    """

    vehicle: str
    train: tuple[str, ...]
    held_out: tuple[str, ...]
    verdict: tuple[str, ...]
    causes: tuple[Cause, ...]
    identifiability: Identifiability
    localisation: Localisation
    gap_reduction: GapReduction
    below_threshold: tuple[ResidualFinding, ...] = ()
    unexplained: tuple[ResidualFinding, ...] = ()
    unknown_probability: float = 0.0
    cannot_tell: bool = False
    warnings: tuple[str, ...] = ()
    wall: float = float("nan")  # [s]
    joined: tuple[str, ...] = ()
    judged_as: str = ""
    refit: "Diagnosis | None" = None
    new_on_held_out: tuple[ResidualFinding, ...] = ()
    posterior: Posterior | None = None
    doubts: tuple[str, ...] = ()
    not_flyable: str = ""
    nominal: Vehicle | None = None
    rotors: tuple[RotorName, ...] = ()
    calibration: tuple[Difference, ...] = ()
    headline: str = ""
    before: tuple[str, ...] = ()
    visible: dict[str, float] = dc.field(default_factory=dict)

    def __repr__(self) -> str:
        """Return vehicle and headline in a line."""
        return f"Diagnosis({self.vehicle}: {self.headline or ', '.join(self.verdict)})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the headline, a row for every parameter of a cause, and the
        first warnings.
        """
        rows = [
            (
                c.identifier,
                probability(c.probability),
                ", ".join(f"{n} {_shown(e)}" for n, e in c.parameters.items()),
            )
            for c in self.causes
        ]
        header = ("cause", "probability", "parameters, ± half of the 95 % interval")
        return html_table(f"{self.vehicle}: {self.headline}", header, rows, self.warnings[:3])

    def as_json(self) -> dict[str, Any]:
        """Return the content of `diagnosis.json` in plain types, without residual series and fitted
        objects.

        Values that are not finite become None.
        """
        identifiability = self.identifiability
        reduction = self.gap_reduction
        before = reduction.replay_before
        after = reduction.replay_after
        head = ["vehicle", "train", "held_out", "joined", "judged_as", "doubts", "verdict"]
        head += ["before", "visible"] if self.before else []
        # The gap by kind and axis, the replay's medians, and its parts by regime.
        gap: dict[str, Any] = {"force": {}, "torque": {}}
        for channel in self.localisation.channels:
            kind, axis = channel.channel.split()
            gap[kind][axis] = _fields(channel, "unit", "rms", "noise_floor", "after")
        gap["kinds"] = [
            {
                **_fields(kind, "kind", "unit", "before", "after", "noise"),
                "left": kind.remaining,
                "above_noise": kind.above_noise,
            }
            for kind in gap_kinds(self.localisation.channels)
        ]
        gap["regimes"] = [_fields(regime) for regime in self.localisation.regimes]
        gap["replay"] = before and {"horizon": before.horizon, **before.medians()}
        replay = (before or after) and {
            **_fields(before or after, "horizon", "starts"),
            "before": before and before.medians() | before.intervals(),
            "after": after and after.medians() | after.intervals(),
        }
        steps = {
            c.identifier: {
                name: [{"time": t, "mass": m.value, "ci95": m.ci95} for t, m in c.steps(name)]
                for name in c.onset
            }
            for c in self.causes
        }
        return plain(
            {
                "schema": SCHEMA,
                **_fields(self, *head, "cannot_tell", "unknown_probability"),
                "calibration": [
                    {k: v for k, v in dc.asdict(d).items() if k != "by_flight" or v}
                    for d in self.calibration
                ],
                "causes": [
                    {
                        "effect": c.identifier,
                        **_fields(c, "probability", "share", "held_out_gain"),
                        **({"changed": c.changed} if self.before else {}),
                        **({"rotor": dc.asdict(c.rotor)} if c.rotor else {}),
                        "parameters": {name: dc.asdict(e) for name, e in c.parameters.items()},
                        "onset": c.onset,
                        "absent_from": [e for e, time in c.onset.items() if time == np.inf],
                        **({"steps": steps[c.identifier]} if c.loads else {}),
                        "indistinguishable_from": c.indistinguishable_from,
                    }
                    for c in self.causes
                ],
                "gap": gap,
                "shrink": {
                    "residual": _fields(reduction, "before", "after", "floor", "fraction", "ci95"),
                    "left": dc.asdict(reduction.remainder),
                    "replay": replay,
                },
                "minor": [_fields(finding) for finding in self.below_threshold],
                "remains": [_fields(finding) for finding in self.unexplained],
                "novel": [_fields(finding) for finding in self.new_on_held_out],
                "check": _fields(
                    identifiability, "usable", "excitation", "noise_floor", "warnings"
                ),
                **_fields(self, "not_flyable", "warnings", "wall"),
                "refit": None
                if self.refit is None
                else {k: v for k, v in self.refit.as_json().items() if k != "schema"},
            }
        )


def _shown(estimate: Estimate) -> str:
    """Return value, half of the 95 % interval and unit, with the digits that the interval tells."""
    half = estimate.half
    unit = "" if estimate.unit in ("", "1") else f" {estimate.unit}"
    if not 0 < half < np.inf:
        return f"{estimate.value:.4g}{unit}"
    digits = max(0, 1 - int(np.floor(np.log10(half))))
    return f"{estimate.value:.{digits}f} ± {half:.{digits}f}{unit}"


Replay = Callable[[list[FlightLog], list[tuple[Effect, dict[str, float | None]]]], ReplayGap]
"""Replay of held-out logs in a simulator: (logs, effects with their onset by flight) -> error; [] is nominal.

Times of logs and onsets count from the flight's first row.
"""  # noqa: E501


def _fields(item: Any, *names: str) -> dict[str, Any]:
    """Return some fields of a dataclass by name; default: all."""
    chosen = names or [field.name for field in dc.fields(item)]
    return {name: getattr(item, name) for name in chosen}
