"""Design of the next flight beside naive manoeuvres of the same length."""

import dataclasses as dc
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from np_drake.diagnosis.numerics import Readings
from np_drake.effects.explanation import Explanation
from np_drake.flight_design.expected_residual import expected_information
from np_drake.flight_design.information import SURE, Information
from np_drake.flight_design.limits import Limits
from np_drake.flight_design.motion import Basis, DesignedMotion, Shrunk
from np_drake.flight_design.naive import naive_motions
from np_drake.flight_design.nominal_flight import nominal_residuals
from np_drake.flight_design.search import Search, projected
from np_drake.references.base import Reference

DESIGNED = "designed"
SHARE = 0.8  # of the limits that a motion uses, as the flight overshoots its reference [1]; own choice
SMALLER, GENTLE = 0.8, 0.3  # steps of size to a gentler motion, and its usage of limits [1]; own choice
EVALUATIONS = 300  # of the information, about 50 ms each


@dc.dataclass(frozen=True)
class Candidate:
    """Motion, what it can tell, and the share of each limit that it uses [1]."""

    name: str
    reference: Reference
    information: Information
    usage: Mapping[str, float]

    @property
    def tightest(self) -> str:
        """Limit of which it uses the most."""
        return max(self.usage, key=lambda name: self.usage[name])


@dc.dataclass(frozen=True)
class FlightDesigner:
    """Problem of a design: explanations to separate, how residuals are read, limits, and length.

    seconds: of the flight [s].   accelerations: whether the next log has them.
    """

    explanations: Sequence[Explanation]
    readings: Readings
    limits: Limits
    seconds: float
    accelerations: bool = True

    @property
    def basis(self) -> Basis:
        """Motions that are combined, on the grid of the residuals."""
        return Basis(self.seconds, self.readings.noise.step)

    def information(self, reference: Reference) -> Information:
        """Return what a motion can tell."""
        t = self.basis.t
        flight = nominal_residuals(
            self.limits.vehicle, t, reference.sample(t), accelerations=self.accelerations
        )
        return expected_information(flight, self.explanations, self.readings)

    def candidate(self, name: str, reference: Reference) -> Candidate:
        """Return a motion with what it can tell and uses."""
        t = self.basis.t
        usage = self.limits.usage(t, reference.sample(t))
        return Candidate(name, reference, self.information(reference), usage)

    def shrunk(self, candidate: Candidate, factor: float) -> Candidate:
        """Return the motion shrunk about the middle of the room by `factor` [1]."""
        return self.candidate(candidate.name, Shrunk(candidate.reference, self.limits.center, factor))

    def candidates(
        self,
        *,
        evaluations: int = EVALUATIONS,
        seed: int = 0,
        tell: Callable[[float], None] | None = None,
    ) -> list[Candidate]:
        """Return the designed motion, then the naive ones.

        The designed one is never worse than these by `Information.value`: where none better is found it is the best of
        them. Where all is sure the search ends, and the motion is made gentler.

        Args:
            evaluations: budget of the search.
            seed: of its draws.
            tell: called with the share done [1].
        """
        basis, limits = self.basis, self.limits
        motions = naive_motions(limits, basis, SHARE, seed)
        naive = [self.candidate(name, motion) for name, motion in motions.items()]
        starts = [
            motion.coefficients
            if isinstance(motion, DesignedMotion)
            else projected(basis, motion.sample(basis.t))
            for name, motion in motions.items()
            if name != "hover"
        ]
        search = Search(limits, basis, SHARE, evaluations, seed)
        enough = SURE if len(self.explanations) > 1 else np.inf
        motion, _ = search.best(lambda m: self.information(m).value, starts, tell, enough)
        found = self.candidate(DESIGNED, motion)
        best = self.calmer(max([found, *naive], key=lambda c: c.information.value))
        return [dc.replace(best, name=DESIGNED), *naive]

    def calmer(self, candidate: Candidate) -> Candidate:
        """Return the motion made smaller as long as it stays sure, for the gentler is the safer."""
        while candidate.information.sure and max(candidate.usage.values()) > GENTLE:
            smaller = self.shrunk(candidate, SMALLER)
            if not smaller.information.sure:
                break
            candidate = smaller
        return candidate
