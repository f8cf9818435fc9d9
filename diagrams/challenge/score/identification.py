"""How often verdicts are right: by name and by class, per kind of case and effect, as confusions
and probabilities.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from diagrams.challenge.draw import CLEAN, OUT_OF_LIBRARY
from diagrams.challenge.score.answered_case import AnsweredCase
from diagrams.challenge.score.binomial_intervals import (
    binned,
    binomial_interval,
    precision_and_recall,
)
from np_drake.diagnosis.result import UNKNOWN
from np_drake.effects.library import LIBRARY, MEASURED_ROTORS

WIDEST = 3  # names that a class may hold, a cause's own included: more tell nothing
SURE = 0.9  # probability of a cause above which a wrong name counts as a claim
WINDS, COMPANION = (
    {"constant_wind", "gusty_wind"},
    {"linear_drag"},
)  # a wind acts through the drag beside it
NONE, SEVERAL = "none", "several"
EDGES = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0)  # of the bins of probability [1]


def matches(case: AnsweredCase) -> dict[int, str]:
    """Return true effect number -> cause that stands for it; as many as possible, each cause once,
    own names first.
    """
    named = case.named
    if not named or not case.true_names:
        return {}
    # Largest total worth of an assignment: a match counts 1, a cause of the effect's own name a
    # hundredth more.
    worth = np.array(
        [
            [_stands_for(case, i, name) * (1.0 + 0.01 * (name == true)) for name in named]
            for i, true in enumerate(case.true_names)
        ]
    )
    pairs = zip(*linear_sum_assignment(worth, maximize=True), strict=True)
    return {int(i): named[j] for i, j in pairs if worth[i, j] > 0}


def _stands_for(case: AnsweredCase, true: int, name: str) -> bool:
    """Return whether the cause `name` stands for true effect number `true`; too wide a class stands
    for none.
    """
    own = (name, *case.causes.get(name, {}).get("indistinguishable_from", ()))
    return len(set(own)) <= WIDEST and (
        name in case.truth["class"][true] or case.true_names[true] in own
    )


def exact(case: AnsweredCase) -> bool:
    """Return whether the verdict names all true effects that can be told, and nothing that does not
    act.
    """
    return _exact_without(case, set())


def exact_lenient(case: AnsweredCase) -> bool:
    """Return whether the verdict is exact but for a wind's drag, which may be missing."""
    return _exact_without(case, COMPANION if WINDS & set(case.true_names) else set())


def _exact_without(case: AnsweredCase, spare: set[str]) -> bool:
    needed = {case.true_names[i] for i in case.must_be_named}
    return needed - spare <= set(case.verdict) - spare <= set(case.true_names) - spare


def right_class(case: AnsweredCase, *, unknown_allowed: bool = False) -> bool:
    """Return whether causes and true effects match one to one.

    An effect within what the files may be off by may be named or not.

    Args:
        unknown_allowed: whether `unknown` is no excess name.
    """
    if UNKNOWN in case.verdict and not unknown_allowed:
        return False
    found = matches(case)
    return len(found) == len(case.named) and set(case.must_be_named) <= set(found)


def detected(case: AnsweredCase) -> bool:
    """Return whether the main effect has its cause, whatever else is named."""
    return 0 in matches(case)


def identifiable_in_training(case: AnsweredCase) -> bool:
    """Return whether the training flights tell every true effect from all others but a few.

    One that is lost in noise, or in what vehicle file and sensors may be off by, is the same as any
    other, and as none.
    """
    return all(len(names) <= WIDEST for names in _classes(case))


def name_counts(case: AnsweredCase) -> tuple[int, int, int]:
    """Return how many names are right, too many (`unknown` among them) and missing, by class."""
    found = matches(case)
    missing = set(case.must_be_named) - set(found)
    return len(found), len(case.verdict) - len(found), len(missing)


def is_true(case: AnsweredCase, name: str) -> bool:
    """Return whether a name is that of a true effect, or physically the same."""
    return any(name in names for names in _classes(case))


def _classes(case: AnsweredCase) -> list[set[str]]:
    """Return by true effect its own name and those of the same class."""
    return [{true, *same} for true, same in zip(case.true_names, case.truth["class"], strict=True)]


def wrong_and_sure(case: AnsweredCase) -> bool:
    """Return whether the verdict holds a name that is not true, with a probability above `SURE`."""
    sure = [
        name for name in case.named if (case.causes.get(name, {}).get("probability") or 0.0) > SURE
    ]
    return any(not is_true(case, name) for name in sure)


def singles(cases: Sequence[AnsweredCase]) -> dict[str, Any]:
    """Return shares of cases of one effect with the right name and the right class."""
    return {
        "class": binomial_interval(right_class(c) for c in cases),
        "class_unknown_allowed": binomial_interval(
            right_class(c, unknown_allowed=True) for c in cases
        ),
        "exact": binomial_interval(exact(c) for c in cases),
        "exact_lenient": binomial_interval(exact_lenient(c) for c in cases),
        "detected": binomial_interval(detected(c) for c in cases),
    }


def several(cases: Sequence[AnsweredCase]) -> dict[str, Any]:
    """Return precision, recall and F1 of names in pairs and triples, all and visible, and whole
    cases right.

    unknown: share to which `unknown` is added, though the library has all that acts.
    """
    visible = [c for c in cases if c.visible]
    return {
        "all": precision_and_recall([name_counts(c) for c in cases]),
        "visible": precision_and_recall([name_counts(c) for c in visible]),
        "class": binomial_interval(right_class(c) for c in visible),
        "unknown": binomial_interval(UNKNOWN in c.verdict for c in cases),
    }


def clean(cases: Sequence[AnsweredCase]) -> dict[str, Any]:
    """Return false alarms on clean controls; a control without an answer counts as one."""
    return {
        "false_alarm": binomial_interval(bool(c.verdict) or c.answer is None for c in cases),
        "named": binomial_interval(bool(c.named) for c in cases),
    }


def out_of_library(cases: Sequence[AnsweredCase]) -> dict[str, Any]:
    """Return how often out-of-library effects are called unknown, and how often a wrong name is
    given confidently.

    kinds: the same by effect, or by two at once, and as what each is misnamed.
    """
    visible = [c for c in cases if c.visible]
    by_kind: dict[str, list[AnsweredCase]] = {}
    for c in visible:
        by_kind.setdefault(" + ".join(c.true_names), []).append(c)
    return {
        **_called_unknown(visible),
        "unknown_two": binomial_interval(
            UNKNOWN in c.verdict for c in visible if len(c.true_names) > 1
        ),
        "unknown_all": binomial_interval(UNKNOWN in c.verdict for c in cases),
        "wrong_and_sure_all": binomial_interval(wrong_and_sure(c) for c in cases),
        "kinds": [
            {
                "kind": kind,
                **_called_unknown(mine),
                "named": dict(Counter(name for c in mine for name in c.named).most_common()),
            }
            for kind, mine in sorted(by_kind.items())
        ],
    }


def _called_unknown(cases: Sequence[AnsweredCase]) -> dict[str, Any]:
    return {
        "unknown": binomial_interval(UNKNOWN in c.verdict for c in cases),
        "alone": binomial_interval(c.verdict == (UNKNOWN,) for c in cases),
        "wrong_and_sure": binomial_interval(wrong_and_sure(c) for c in cases),
    }


def confusion(cases: Sequence[AnsweredCase]) -> dict[str, Any]:
    """Return counts of (what acts, what is named), of clean controls and of visible cases of one
    effect.
    """
    shown = [
        c
        for c in cases
        if c.kind == CLEAN or (c.kind in ("single", "onset", OUT_OF_LIBRARY) and c.visible)
    ]
    cells = Counter((c.main, verdict_in_a_word(c)) for c in shown)
    acting, said = ({cell[i] for cell in cells} for i in (0, 1))
    rows = [name for name in (*LIBRARY, OUT_OF_LIBRARY, CLEAN) if name in acting]
    columns = [
        *LIBRARY,
        *(name for name in MEASURED_ROTORS if name in said),
        UNKNOWN,
        SEVERAL,
        NONE,
    ]
    return {
        "true": rows,
        "named": columns,
        "counts": [[cells[a, b] for b in columns] for a in rows],
    }


def verdict_in_a_word(case: AnsweredCase) -> str:
    """Return the one name, `none` or `several`; where a wind is named its drag is no second
    name.
    """
    names = set(case.verdict)
    if names & WINDS:
        names -= COMPANION
    if len(names) > 1:
        return SEVERAL
    word = next(iter(names), NONE)
    return word if word in LIBRARY | MEASURED_ROTORS or word in (NONE, UNKNOWN) else SEVERAL


def reliability(cases: Iterable[AnsweredCase]) -> dict[str, Any]:
    """Return reported probabilities of named causes against whether they are true.

    brier: mean square of probability minus outcome.
    ece: mean of |share right - mean probability| over bins, weighted by count.
    """
    pairs = [
        (float(p), is_true(case, name))
        for case in cases
        for name in case.named
        if (p := case.causes.get(name, {}).get("probability")) is not None
    ]
    if not pairs:
        return {"n": 0, "bins": [], "brier": None, "ece": None}
    probability, right = (np.array(column, float) for column in zip(*pairs, strict=True))
    # Upper edges belong to the bin.
    place = np.clip(np.searchsorted(EDGES, probability) - 1, 0, len(EDGES) - 2)
    rows = binned(right, place, EDGES, mean=(np.mean, probability))
    return {
        "n": len(pairs),
        "bins": rows,
        "brier": float(np.mean((probability - right) ** 2)),
        "ece": sum(row["n"] * abs(row["rate"] - row["mean"]) for row in rows) / len(pairs),
    }
