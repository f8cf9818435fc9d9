"""Result of an examination of flight logs as dataclasses; `as_json` gives the content of `np-drake
doctor --json`.
"""

import dataclasses as dc
from typing import Any

from np_drake.files.atomic_file import plain
from np_drake.logs.clock import Lag

YES, NO, NEVER = "yes", "no", "never"


@dc.dataclass(frozen=True)
class SignalFacts:
    """Facts of one signal of a log: white noise and what is usual, resolution and share of repeated
    rows.

    white: standard deviation of its white noise, from second differences; the largest of its
    columns, in `unit`.
    usual: that of the vehicle file or of usual sensors; 0: none is known.
    resolution: step to which the values are rounded, where that is above the noise; else 0.
    repeated: share of rows equal to the row before [1].
    """

    name: str
    unit: str
    white: float
    usual: float
    resolution: float
    repeated: float


@dc.dataclass(frozen=True)
class FlightFacts:
    """Facts of one flight that need no vehicle.

    step: median interval [s]; jitter: standard deviation of intervals over it [1].
    gaps: intervals longer than 2.5 of it; longest: the longest interval [s]; bridged: rows that a
        reader put into gaps. attitude_noise: white noise of the attitude against the integrated
        gyro [rad]. misfits: by law, disagreement of quantities with each other: 0 agree, 1 do not
        [1]. motion: by quantity, RMS or span, with the unit in the key.
    saturated: share of rows with a rotor at a limit [1]; None where no limit is known.
    imported: what its import did; empty for a log of our format.
    """

    name: str
    duration: float
    rows: int
    step: float
    jitter: float
    gaps: int
    longest: float
    bridged: int
    input: str
    timing: float
    signals: tuple[SignalFacts, ...]
    attitude_noise: float
    misfits: dict[str, float]
    lags: tuple[Lag, ...]
    motion: dict[str, float]
    saturated: float | None = None
    notes: tuple[str, ...] = ()
    imported: dict[str, Any] = dc.field(default_factory=dict)


@dc.dataclass(frozen=True)
class SwingTest:
    """Comparison of a pendulum of the best length with none, in one flight.

    log_bayes_factor: for a pendulum of any length [nat]; something swings from `evident` on.
    length, mass: of the best pendulum [m, kg].
    """

    flight: str
    log_bayes_factor: float
    evident: float
    swings: bool
    length: float
    mass: float


@dc.dataclass(frozen=True)
class Answer:
    """Whether a log can tell one parameter of an effect.

    smallest: size that is told from zero at 99.7 % (three posterior deviations), beside nuisance
    parameters and the
    effects named in `beside`; infinite: none.   alone: the same beside nuisance parameters only.
    typical: usual size for a vehicle of this mass and arm.
    verdict: `yes` (smallest is at most typical), `no`, or `never` (a log of this kind has no trace
        of it).
    todo: what to log or fly instead; empty for `yes`.
    """

    identifier: str
    parameter: str
    unit: str
    smallest: float
    alone: float
    typical: float
    verdict: str
    reason: str = ""
    todo: str = ""
    beside: tuple[str, ...] = ()


@dc.dataclass(frozen=True)
class LogReport:
    """Result of `examine`.

    usable: whether anything can be diagnosed; problems: what stands against it, or limits it, one
    line each.
    excitation: RMS values and spans over all flights; with the vehicle's where one is given.
    residual_force: by axis of B, RMS of the residual force over weight, nothing fitted [1]; empty
        without a vehicle.
    noise_floor: by channel, RMS of what no effect explains [N, N·m]; empty without a vehicle.
    """

    flights: tuple[FlightFacts, ...]
    usable: bool
    problems: tuple[str, ...]
    vehicle: str = ""
    sensors: str = ""
    excitation: dict[str, float] = dc.field(default_factory=dict)
    noise_floor: dict[str, float] = dc.field(default_factory=dict)
    swings: tuple[SwingTest, ...] = ()
    answers: tuple[Answer, ...] = ()
    residual_force: dict[str, float] = dc.field(default_factory=dict)

    @property
    def something_swings(self) -> bool:
        """Whether something swings in any flight."""
        return any(test.swings for test in self.swings)

    def of(self, identifier: str) -> tuple[Answer, ...]:
        """Return the answers for the parameters of one effect."""
        return tuple(a for a in self.answers if a.identifier == identifier)

    def as_json(self) -> dict[str, Any]:
        """Return the report in plain types; values that are not finite become None."""
        content = dc.asdict(self)
        content["something_swings"] = self.something_swings
        return plain(content)
