"""Result of the adequacy tests."""

import dataclasses as dc

from np_drake.diagnosis.result import Finding


@dc.dataclass(frozen=True)
class Unexplained:
    """What the effects of the best model leave.

    probability: that something material is left, a slow level force apart [1].   findings: where it lives.
    slow_probability: of a slow level force [1].
    """

    probability: float
    findings: tuple[Finding, ...]
    slow_probability: float
