"""Laws of the effects that explain the logs as well in place of one of the model's."""

import dataclasses as dc

from np_drake.diagnosis.decision.causes import MOST_ALTERNATIVES, equivalents
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import Model

OPTIONS = Options.for_sensors(True)
NEAR = OPTIONS.thresholds.indistinguishable_evidence


@dc.dataclass
class Candidate:
    identifiers: tuple[str, ...]
    generic: bool = False


class Problem:
    """A regression whose models have given scores; others are far worse."""

    options = OPTIONS

    def __init__(self, candidates, scores, apart=()):
        self.candidates, self._scores, self._apart = candidates, scores, set(apart)

    def score(self, members):
        return self._scores.get(tuple(sorted(members)), -1e6)

    def fits_together(self, members):
        return tuple(sorted(members)) not in self._apart


NAMES = ["drag", "a", "b", "c", "d", "e"]
EVERY = [Candidate((name,)) for name in NAMES]


def test_alternatives_stand_best_first_within_the_threshold():
    scores = {(0,): 0.0, (1,): -0.6 * NEAR, (2,): -0.1 * NEAR, (3,): -1.01 * NEAR, (4,): 0.2 * NEAR}
    dut = equivalents(Problem(EVERY, scores), Model((0,), 0.0))
    assert list(dut) == ["drag"]
    assert dut["drag"] == ("d", "b", "a")[:MOST_ALTERNATIVES]


def test_structure_the_effect_itself_and_what_does_not_fit_are_none():
    candidates = [
        Candidate(("drag",)),
        Candidate(("a",), generic=True),
        Candidate(("drag",)),
        Candidate(("b",)),
    ]
    scores = {(0,): 0.0, (1,): 0.0, (2,): 0.0, (3,): 0.0}
    assert equivalents(Problem(candidates, scores, apart=[(3,)]), Model((0,), 0.0)) == {"drag": ()}
    assert equivalents(Problem(candidates, scores), Model((1,), 0.0)) == {}
