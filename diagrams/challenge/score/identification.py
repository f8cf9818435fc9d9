"""How often names are right: single effects, pairs and triples, clean controls, foreign effects, each effect."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

from diagrams.challenge.score.answered_case import Solved
from diagrams.challenge.score.intervals import name_rates, rate
from diagrams.challenge.score.matching import (
    detected,
    exact,
    exact_lenient,
    is_true,
    names_right,
    right_class,
)
from np_drake.diagnosis.result import UNKNOWN

SURE = 0.9  # probability of a cause above which a wrong name counts as a claim


def singles(cases: Sequence[Solved]) -> dict[str, Any]:
    """Cases of one effect: shares with the right name and the right class."""
    return {
        "class": rate(right_class(c) for c in cases),
        "class_unknown_allowed": rate(right_class(c, unknown_allowed=True) for c in cases),
        "exact": rate(exact(c) for c in cases),
        "exact_lenient": rate(exact_lenient(c) for c in cases),
        "detected": rate(detected(c) for c in cases),
    }


def several(cases: Sequence[Solved], least: float) -> dict[str, Any]:
    """Pairs and triples: precision, recall and F1 of names, of all and of the visible, and whole cases right."""
    return {
        "all": name_rates([names_right(c) for c in cases]),
        "visible": name_rates([names_right(c) for c in cases if c.visibility >= least]),
        "class": rate(right_class(c) for c in cases if c.visibility >= least),
    }


def clean(cases: Sequence[Solved]) -> dict[str, Any]:
    """False alarms on clean controls. A control without an answer counts as one."""
    return {
        "false_alarm": rate(bool(c.verdict) or c.answer is None for c in cases),
        "named": rate(bool(c.named) for c in cases),
    }


def foreign(cases: Sequence[Solved], least: float) -> dict[str, Any]:
    """Effects that the library does not have: how often called unknown, how often called something else, surely."""
    visible = [c for c in cases if c.visibility >= least]
    return {
        "unknown": rate(UNKNOWN in c.verdict for c in visible),
        "unknown_all": rate(UNKNOWN in c.verdict for c in cases),
        "wrong_and_sure": rate(bool(wrong_and_sure(c)) for c in visible),
        "wrong_and_sure_all": rate(bool(wrong_and_sure(c)) for c in cases),
        "alone": rate(c.verdict == (UNKNOWN,) for c in visible),
        "kinds": [foreign_kind(kind, visible) for kind in sorted({c.true_names[0] for c in visible})],
    }


def foreign_kind(kind: str, cases: Sequence[Solved]) -> dict[str, Any]:
    """Of the cases of one kind: how many are called unknown, nothing else, surely something else, and what."""
    mine = [c for c in cases if c.true_names[0] == kind]
    said = Counter(name for c in mine for name in c.named)
    return {
        "kind": kind,
        "unknown": rate(UNKNOWN in c.verdict for c in mine),
        "alone": rate(c.verdict == (UNKNOWN,) for c in mine),
        "wrong_and_sure": rate(bool(wrong_and_sure(c)) for c in mine),
        "named": dict(said.most_common()),
    }


def wrong_and_sure(case: Solved) -> list[str]:
    """Names in the verdict that are not true, with a probability above `SURE`."""
    return [
        name
        for name in case.named
        if (case.causes.get(name, {}).get("probability") or 0.0) > SURE and not is_true(case, name)
    ]


def of_effect(name: str, cases: Sequence[Solved], least: float) -> dict[str, Any]:
    """Of an effect as the main one of visible cases of one effect, and how often it is named where it does not act."""
    mine = [c for c in cases if c.kind in ("single", "onset") and c.main == name and c.visibility >= least]
    others = [c for c in cases if not is_true(c, name)]
    return {
        "n": len(mine),
        "detected": rate(detected(c) for c in mine),
        "exact": rate(exact_lenient(c) for c in mine),
        "named_wrongly": sum(name in c.verdict for c in others),
    }
