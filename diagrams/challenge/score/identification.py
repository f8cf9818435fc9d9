"""How often verdicts are right: by name and by class, per kind of case and effect, as confusions and probabilities."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from diagrams.challenge.score.answered_case import COMPANION, WINDS, AnsweredCase
from diagrams.challenge.score.binomial_intervals import binned, binomial_interval, precision_and_recall
from np_drake.diagnosis.result import UNKNOWN
from np_drake.effects.library import LIBRARY, MEASURED_ROTORS

WIDEST = 3  # names that a class may hold, a cause's own included: more tell nothing


def class_of(case: AnsweredCase, name: str) -> tuple[str, ...]:
    """Return a cause's own name and those that it says cannot be told from it."""
    return (name, *case.causes.get(name, {}).get("indistinguishable_from", ()))


def stands_for(case: AnsweredCase, true: int, name: str) -> bool:
    """Return whether the cause `name` stands for true effect number `true`; too wide a class stands for none."""
    own = class_of(case, name)
    same = case.truth["class"][true]
    return len(set(own)) <= WIDEST and (name in same or case.true_names[true] in own)


def matches(case: AnsweredCase) -> dict[int, str]:
    """Return true effect number -> cause that stands for it; as many as possible, each cause once, own names first."""
    named = case.named
    if not named or not case.true_names:
        return {}
    worth = np.array(
        [
            [stands_for(case, i, name) * (1.0 + 0.01 * (name == true)) for name in named]
            for i, true in enumerate(case.true_names)
        ]
    )
    pairs = zip(*linear_sum_assignment(-worth), strict=True)
    return {int(i): named[j] for i, j in pairs if worth[i, j] > 0}


def exact(case: AnsweredCase) -> bool:
    """Return whether the verdict names all true effects that can be told, and nothing that does not act."""
    return _needed(case) <= set(case.verdict) <= set(case.true_names)


def exact_lenient(case: AnsweredCase) -> bool:
    """Return whether the verdict is exact but for a wind's drag, which may be missing."""
    spare = {COMPANION} if set(WINDS) & set(case.true_names) else set()
    return _needed(case) - spare <= set(case.verdict) - spare <= set(case.true_names) - spare


def _needed(case: AnsweredCase) -> set[str]:
    return {case.true_names[i] for i in case.must_be_named}


def right_class(case: AnsweredCase, *, unknown_allowed: bool = False) -> bool:
    """Return whether causes and true effects match one to one; `unknown` is an excess name unless allowed.

    An effect within what the files may be off by may be named or not.
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

    One that is lost in noise, or in what vehicle file and sensors may be off by, is the same as any other, and as none.
    """
    return all(len({name, *same}) <= WIDEST for name, same in _with_class(case))


def name_counts(case: AnsweredCase) -> tuple[int, int, int]:
    """Return how many names are right, too many (`unknown` among them) and missing, by class."""
    found = matches(case)
    missing = set(case.must_be_named) - set(found)
    return len(found), len(case.verdict) - len(found), len(missing)


def is_true(case: AnsweredCase, name: str) -> bool:
    """Return whether `name` is a true effect, or physically the same as one."""
    return any(name in {true, *same} for true, same in _with_class(case))


def _with_class(case: AnsweredCase) -> list[tuple[str, list[str]]]:
    """Return every true effect with its class."""
    return list(zip(case.true_names, case.truth["class"], strict=True))


SURE = 0.9  # probability of a cause above which a wrong name counts as a claim


def singles(cases: Sequence[AnsweredCase]) -> dict[str, Any]:
    """Return shares of cases of one effect with the right name and the right class."""
    return {
        "class": binomial_interval(right_class(c) for c in cases),
        "class_unknown_allowed": binomial_interval(right_class(c, unknown_allowed=True) for c in cases),
        "exact": binomial_interval(exact(c) for c in cases),
        "exact_lenient": binomial_interval(exact_lenient(c) for c in cases),
        "detected": binomial_interval(detected(c) for c in cases),
    }


def several(cases: Sequence[AnsweredCase], least: float) -> dict[str, Any]:
    """Return precision, recall and F1 of names in pairs and triples, all and visible, and whole cases right.

    unknown: share to which `unknown` is added, though the library has all that acts.
    """
    return {
        "all": precision_and_recall([name_counts(c) for c in cases]),
        "visible": precision_and_recall([name_counts(c) for c in cases if c.visibility >= least]),
        "class": binomial_interval(right_class(c) for c in cases if c.visibility >= least),
        "unknown": binomial_interval(UNKNOWN in c.verdict for c in cases),
    }


def clean(cases: Sequence[AnsweredCase]) -> dict[str, Any]:
    """Return false alarms on clean controls; a control without an answer counts as one."""
    return {
        "false_alarm": binomial_interval(bool(c.verdict) or c.answer is None for c in cases),
        "named": binomial_interval(bool(c.named) for c in cases),
    }


def out_of_library(cases: Sequence[AnsweredCase], least: float) -> dict[str, Any]:
    """Return how often out-of-library effects are called unknown, and how often a wrong name is given confidently."""
    visible = [c for c in cases if c.visibility >= least]
    return {
        "unknown": binomial_interval(UNKNOWN in c.verdict for c in visible),
        "unknown_two": binomial_interval(UNKNOWN in c.verdict for c in visible if len(c.true_names) > 1),
        "unknown_all": binomial_interval(UNKNOWN in c.verdict for c in cases),
        "wrong_and_sure": binomial_interval(bool(wrong_and_sure(c)) for c in visible),
        "wrong_and_sure_all": binomial_interval(bool(wrong_and_sure(c)) for c in cases),
        "alone": binomial_interval(c.verdict == (UNKNOWN,) for c in visible),
        "kinds": [
            out_of_library_effect(kind, visible)
            for kind in sorted({" + ".join(c.true_names) for c in visible})
        ],
    }


def out_of_library_effect(kind: str, cases: Sequence[AnsweredCase]) -> dict[str, Any]:
    """Return how often one out-of-library effect, or two at once, is called unknown or misnamed, and as what."""
    mine = [c for c in cases if " + ".join(c.true_names) == kind]
    said = Counter(name for c in mine for name in c.named)
    return {
        "kind": kind,
        "unknown": binomial_interval(UNKNOWN in c.verdict for c in mine),
        "alone": binomial_interval(c.verdict == (UNKNOWN,) for c in mine),
        "wrong_and_sure": binomial_interval(bool(wrong_and_sure(c)) for c in mine),
        "named": dict(said.most_common()),
    }


def wrong_and_sure(case: AnsweredCase) -> list[str]:
    """Return names in the verdict that are not true, with a probability above `SURE`."""
    return [
        name
        for name in case.named
        if (case.causes.get(name, {}).get("probability") or 0.0) > SURE and not is_true(case, name)
    ]


def effect_counts(name: str, cases: Sequence[AnsweredCase], least: float) -> dict[str, Any]:
    """Return how often an effect is found as the main one of a visible case, and named where it does not act."""
    mine = [c for c in cases if c.kind in ("single", "onset") and c.main == name and c.visibility >= least]
    others = [c for c in cases if not is_true(c, name)]
    return {
        "n": len(mine),
        "detected": binomial_interval(detected(c) for c in mine),
        "exact": binomial_interval(exact_lenient(c) for c in mine),
        "named_wrongly": sum(name in c.verdict for c in others),
    }


NONE, SEVERAL = "none", "several"
EDGES = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0)  # of the bins of probability [1]


def confusion(cases: Sequence[AnsweredCase], least: float) -> dict[str, Any]:
    """Return counts of (what acts, what is named), of clean controls and of visible cases of one effect."""
    shown = [c for c in cases if c.kind in ("single", "onset", "foreign") and c.visibility >= least]
    shown += [c for c in cases if c.kind == "clean"]
    acting = {c.main for c in shown}
    rows = [name for name in (*LIBRARY, "foreign", "clean") if name in acting]
    said = {verdict_in_a_word(c) for c in shown}
    columns = [*LIBRARY, *(name for name in MEASURED_ROTORS if name in said), UNKNOWN, SEVERAL, NONE]
    counts = np.zeros((len(rows), len(columns)), int)
    for case in shown:
        counts[rows.index(case.main), columns.index(verdict_in_a_word(case))] += 1
    return {"true": rows, "named": columns, "counts": counts.tolist()}


def verdict_in_a_word(case: AnsweredCase) -> str:
    """Return the one name, `none` or `several`; where a wind is named its drag is no second name."""
    names = set(case.verdict)
    if names & set(WINDS):
        names.discard(COMPANION)
    if len(names) > 1:
        return SEVERAL
    word = next(iter(names), NONE)
    return word if word in LIBRARY | MEASURED_ROTORS or word in (NONE, UNKNOWN) else SEVERAL


def reliability(cases: Iterable[AnsweredCase]) -> dict[str, Any]:
    """Return reported probabilities of named causes against whether they are true.

    brier: mean square of probability minus outcome.   ece: mean of |share right - mean probability| over bins,
    weighted by count.
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
    rows = _bins(probability, right)
    gaps = [row["n"] * abs(row["rate"] - row["mean"]) for row in rows]
    return {
        "n": len(pairs),
        "bins": rows,
        "brier": float(np.mean((probability - right) ** 2)),
        "ece": sum(gaps) / len(pairs),
    }


def _bins(probability: np.ndarray, right: np.ndarray) -> list[dict[str, Any]]:
    """Return the share that is true by probability; upper edges belong to the bin, empty bins are left out."""
    place = np.clip(np.searchsorted(EDGES, probability) - 1, 0, len(EDGES) - 2)
    return binned(right, place, EDGES, mean=(np.mean, probability))
