"""What a diagnosis of the flights so far says, and whether it is right by the rule of the challenge."""

import dataclasses as dc
import math
from collections.abc import Sequence
from typing import Any

from diagrams.challenge.active.flown import RealFlight
from diagrams.challenge.generate.case import Case
from diagrams.challenge.generate.ground_truth import collinear_class
from diagrams.challenge.score.answered_case import AnsweredCase
from diagrams.challenge.score.identification import exact_lenient, right_class
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.result import UNKNOWN, Diagnosis
from np_drake.effects.explanation import STANDS, Explanation


@dc.dataclass(frozen=True)
class Answer:
    """Diagnosis of flights, with the true classes of its effects in these flights.

    diagnosis: of the flights so far.   classes: of every withheld effect, the names that these flights cannot tell
    from it, its own first.
    """

    case: Case
    diagnosis: Diagnosis
    classes: list[list[str]]

    @property
    def standing(self) -> tuple[Explanation, ...]:
        """Explanations within the factor `STANDS` of the best; a swap that is farther no longer stands."""
        every = self.diagnosis.explanations
        return tuple(e for e in every if STANDS * e.probability >= every[0].probability)

    @property
    def explanations(self) -> tuple[Explanation, ...]:
        """Explanations that the next flight is to separate: those that stand, or, of one alone, all that came near."""
        return self.standing if len(self.standing) > 1 else self.diagnosis.explanations

    @property
    def settled(self) -> bool:
        """Whether one explanation stands, and the logs hold nothing beside it that no effect explains."""
        return len(self.standing) == 1 and UNKNOWN not in self.diagnosis.verdict

    @property
    def entropy(self) -> float:
        """Entropy over the explanations [nat]; NaN where the flights tell none."""
        every = [e.probability for e in self.diagnosis.explanations]
        return -sum(p * math.log(p) for p in every if p > 0) if every else math.nan

    def record(self) -> dict[str, Any]:
        """Return the answer and its score in plain types."""
        found = self.diagnosis
        same = {c.identifier: list(c.indistinguishable_from) for c in found.causes}
        return {
            "verdict": found.verdict,
            "class": self.classes,
            "explanations": [{"named": e.named, "probability": e.probability} for e in found.explanations],
            "standing": len(self.standing),
            "entropy": self.entropy,
            "settled": self.settled,
            "right_class": right_class(self._scored(found.verdict, same)),
            "right_alone": self.settled and self.right(self.standing[0]),
            "right_stands": any(self.right(e) for e in self.standing),
        }

    def right(self, explanation: Explanation) -> bool:
        """Return whether an explanation names what acts, and nothing else; a wind's drag may be missing."""
        return exact_lenient(self._scored(explanation.named, {}))

    def _scored(self, verdict: Sequence[str], same: dict[str, list[str]]) -> AnsweredCase:
        truth = {
            "effects": [{"effect": e.identifier} for e in self.case.effects],
            "class": self.classes,
            "kind": self.case.draw.kind,
        }
        causes = [{"effect": name, "indistinguishable_from": others} for name, others in same.items()]
        return AnsweredCase(self.case.name, truth, {"verdict": list(verdict), "causes": causes})


def answer_of(case: Case, fitted: Sequence[RealFlight], held_out: RealFlight) -> Answer:
    """Return the diagnosis of flights and their classes.

    Raises: ValueError: if the logs cannot be diagnosed.
    """
    found = diagnose(case.vehicle, [f.log for f in fitted], [held_out.log], adaptive_split=False)
    return Answer(case, found, collinear_class(case, [f.pair for f in fitted]))
