"""Faults of a sampled measurement and of a solver, as pure functions of time and sample.

A reading is the vector (23,) of x (13), acceleration (6) and rotor speed (4), in the order of
`READING`.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.mpc.problem import MpcProblem, MpcSolution, MpcSolver, SolverFailure

READING = {"x": slice(0, 13), "acceleration": slice(13, 19), "rotor_speed": slice(19, 23)}
READING_SIZE = 23
# Columns of a reading by sensor. Velocity is differentiated motion capture.
SENSORS = {
    "motion capture": (*range(0, 10),),
    "gyroscope": (*range(10, 13), *range(16, 19)),
    "accelerometer": (*range(13, 16),),
    "imu": (*range(10, 19),),
    "all": (*range(0, 19),),
}
_ROUNDING = 1e-9  # of a sample's time [s]


@dc.dataclass(frozen=True)
class MeasurementFault:
    """Fault that acts on one sensor from `onset` on for `duration` [s].

    sensor: key of `SENSORS`.   A sample k is the reading at k periods.
    """

    onset: float
    duration: float
    sensor: str

    @property
    def columns(self) -> tuple[int, ...]:
        """Columns of a reading on which it acts."""
        return SENSORS[self.sensor]

    def acts(self, t: float) -> bool:
        """Return whether it acts at time t [s]."""
        return -_ROUNDING <= t - self.onset < self.duration - _ROUNDING

    def first(self, period: float) -> int:
        """Return the first sample on which it acts."""
        return int(np.ceil(self.onset / period - 1e-6))

    def delivered(self, k: int, period: float) -> int:
        """Return the sample that is delivered in place of sample k; `period` [s]."""
        return k

    def reads(self, reading: np.ndarray) -> np.ndarray:
        """Return what is read in place of a reading (23,)."""
        return reading

    def oldest(self, period: float) -> int:
        """Return how many samples back it reaches at most; 0 where it delivers no other sample."""
        if type(self).delivered is MeasurementFault.delivered:
            return 0
        return int(np.ceil(self.duration / period)) + 1


@dc.dataclass(frozen=True)
class NanBurst(MeasurementFault):
    """Samples without a value."""

    def reads(self, reading: np.ndarray) -> np.ndarray:
        """Return the reading with NaN in the sensor's columns."""
        spoilt = reading.copy()
        spoilt[list(self.columns)] = np.nan
        return spoilt


@dc.dataclass(frozen=True)
class LateSamples(MeasurementFault):
    """Samples that arrive `samples` periods late."""

    samples: int

    def delivered(self, k: int, period: float) -> int:
        """Return the sample taken `samples` periods before."""
        return k - self.samples

    def oldest(self, period: float) -> int:
        """Return how many samples back it reaches."""
        return self.samples


@dc.dataclass(frozen=True)
class FrozenSamples(MeasurementFault):
    """Sensor that keeps the last value before the fault."""

    def delivered(self, k: int, period: float) -> int:
        """Return the last sample before the fault."""
        return self.first(period) - 1


@dc.dataclass(frozen=True)
class SolverFault:
    """No solve from `onset` on for `duration` [s] has a usable answer."""

    onset: float
    duration: float

    def spoils(self, t: float) -> bool:
        """Return whether the solve of the measurement at time t [s] has no usable answer."""
        return self.onset <= t < self.onset + self.duration


class FaultySolver:
    """Solver that answers as another does, except while one of its faults acts."""

    def __init__(self, solver: MpcSolver, faults: Sequence[SolverFault]):
        self.name = solver.name
        self._solver, self._faults = solver, tuple(faults)

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Solve one problem.

        Raises: SolverFailure: where a fault acts at the problem's time, or the solver fails of its
        own.
        """
        for fault in self._faults:
            if fault.spoils(problem.t):
                raise SolverFailure(f"{self.name}: {type(fault).__name__} at {problem.t:.3f} s.")
        return self._solver.solve(problem, warm_start)
