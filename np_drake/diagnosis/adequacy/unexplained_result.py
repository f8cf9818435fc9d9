"""Result of the adequacy tests."""

import dataclasses as dc

from np_drake.diagnosis.adequacy.residual_tests import UNSEEN
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.result import Finding


@dc.dataclass(frozen=True)
class Unexplained:
    """What the causes leave.

    unknown: whether something material is left.   findings: where it lives.   held: the fit on held-out flights.

    structured: with measured rotor speed, whether there is structure beside the effects, repeated or not.
    """

    unknown: bool
    probability: float
    findings: tuple[Finding, ...]
    held: HeldOut
    slow_probability: float
    structured: bool = False

    @property
    def novel_on_held_out(self) -> bool:
        """Whether held-out flights alone show something."""
        return any(f.name == UNSEEN for f in self.findings)
