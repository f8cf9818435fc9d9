"""Scores answers to a challenge set against its truth: a pure function of the two."""

from collections.abc import Callable, Sequence
from typing import Any

from diagrams.challenge.draw import CLEAN, OUT_OF_LIBRARY
from diagrams.challenge.score.answered_case import AnsweredCase
from diagrams.challenge.score.binomial_intervals import binomial_interval, median
from diagrams.challenge.score.detection import detection
from diagrams.challenge.score.estimates import (
    ParameterError,
    by_parameter,
    errors_of,
    onset_errors,
    onset_summary,
    parameter_summary,
)
from diagrams.challenge.score.gap_reduction import (
    PARAMETERS,
    gap_reduction_summary,
    relative_gap_reduction,
    replay_reduction,
    replay_summary,
)
from diagrams.challenge.score.identification import (
    clean,
    confusion,
    detected,
    exact,
    exact_lenient,
    identifiable_in_training,
    is_true,
    matches,
    out_of_library,
    reliability,
    right_class,
    several,
    singles,
    wrong_and_sure,
)
from np_drake.diagnosis.result import UNKNOWN
from np_drake.effects.library import LIBRARY, MEASURED_ROTORS

GUSTS = "gusty_wind"


def score(cases: Sequence[AnsweredCase], *, seed: int = 0) -> dict[str, Any]:
    """Return all metrics; where the set mixes them also by simulator and quality (`groups`) and by
    quality.
    """
    groups = _parts_by(cases, lambda case: case.group)
    qualities = _parts_by(cases, lambda case: str(case.truth["quality"]))
    without = [case.name for case in cases if case.answer is None]
    named = ", ".join(without[:5])
    return {
        **_metrics(cases, seed),
        "groups": {name: _metrics(part, seed) for name, part in groups.items()}
        if len(groups) > 1
        else {},
        "qualities": (
            {name: _metrics(part, seed) for name, part in qualities.items()}
            if len(groups) > len(qualities)
            else {}
        ),
        "sets": [
            {
                "group": name,
                "cases": len(part),
                "seeds": sorted({int(case.truth["seed"]) for case in part}),
            }
            for name, part in groups.items()
        ],
        "warnings": [f"{len(without)} cases have no answer and count as misses: {named}"]
        if without
        else [],
        "cases": [_case_row(case) for case in cases],
    }


def _parts_by(
    cases: Sequence[AnsweredCase], key: Callable[[AnsweredCase], str]
) -> dict[str, list[AnsweredCase]]:
    """Return the cases by key, sorted by it."""
    return {name: [c for c in cases if key(c) == name] for name in sorted({key(c) for c in cases})}


def _metrics(cases: Sequence[AnsweredCase], seed: int) -> dict[str, Any]:
    """Return all metrics of cases that are taken together."""
    single, onset, pair, triple, controls, strange = (
        [c for c in cases if c.kind == kind]
        for kind in ("single", "onset", "pair", "triple", CLEAN, OUT_OF_LIBRARY)
    )
    known = [c for c in cases if c.kind not in (CLEAN, OUT_OF_LIBRARY)]
    visible = [c for c in single if c.visible]
    rates = {
        "single": singles(visible),
        "single_felt": singles([c for c in visible if c.visibility_in_training >= c.least]),
        "single_tellable": singles([c for c in visible if identifiable_in_training(c)]),
        "onset": singles([c for c in onset if c.visible]),
        "pair": several(pair),
        "triple": several(triple),
        "several": several([*pair, *triple]),
        "clean": clean(controls),
        "foreign": out_of_library(strange),
    }
    errors = [error for c in known if c.visible for error in errors_of(c)]
    found = parameter_summary(errors)
    answered = [c.answer for c in cases if c.answer is not None]
    return {
        "accuracy": {
            "single": rates["single"]["class"]["rate"],
            "single_exact": rates["single"]["exact"]["rate"],
            "pair": rates["pair"]["all"]["f1"],
            "triple": rates["triple"]["all"]["f1"],
            "clean_false_alarm": rates["clean"]["false_alarm"]["rate"],
            "unknown": rates["foreign"]["unknown"]["rate"],
        },
        "rates": rates,
        "parameters": {
            **found,
            "coverage": found["coverage"]["rate"],
            "coverage_rate": found["coverage"],
            "rows": by_parameter(errors),
        },
        "onset": onset_summary(known),
        "shrink_relative": gap_reduction_summary(known),
        "shrink_relative_parameters": gap_reduction_summary(known, PARAMETERS),
        "shrink_relative_calm": gap_reduction_summary(
            c for c in known if GUSTS not in c.true_names
        ),
        "shrink_relative_foreign": gap_reduction_summary(strange),
        "replay": replay_summary(known),
        "detection": detection([*single, *onset], seed),
        "reliability": reliability(cases),
        "effects": _effect_rows(cases, errors),
        "confusion": confusion(cases),
        "second_look": binomial_interval(bool(answer.get("joined")) for answer in answered),
        "wall": median(answer.get("wall") for answer in answered),
    }


def _effect_rows(
    cases: Sequence[AnsweredCase], errors: Sequence[ParameterError]
) -> list[dict[str, Any]]:
    """Return, by effect of the library that acts or is named in the set, how it is found, misnamed
    and estimated.
    """
    seen = {name for c in cases for name in (*c.true_names, *c.verdict)}
    alone = [c for c in cases if c.kind in ("single", "onset") and c.visible]
    rows = []
    for name in (n for n in LIBRARY | MEASURED_ROTORS if n in seen):
        mine = [c for c in alone if c.main == name]
        estimated = parameter_summary(e for e in errors if e.effect == name)
        rows.append(
            {
                "effect": name,
                "n": len(mine),
                "detected": binomial_interval(detected(c) for c in mine),
                "exact": binomial_interval(exact_lenient(c) for c in mine),
                "named_wrongly": sum(name in c.verdict and not is_true(c, name) for c in cases),
                "median_error": estimated["median_error"],
                "coverage": estimated["coverage"],
            }
        )
    return rows


def _case_row(case: AnsweredCase) -> dict[str, Any]:
    """Return the outcome of one case."""
    return {
        "case": case.name,
        "group": case.group,
        "kind": case.kind,
        "visibility": case.visibility,
        "true": case.true_names,
        "class": case.truth["class"],
        "verdict": case.verdict,
        "probability": {name: cause.get("probability") for name, cause in case.causes.items()},
        "answered": case.answer is not None,
        "exact": exact(case),
        "right_class": right_class(case),
        "matched": sorted(set(matches(case).values())),
        "missed": _missed(case),
        "onset": onset_errors(case),
        "shrink_relative": relative_gap_reduction(case),
        "replay_reduction": replay_reduction(case),
    }


def _missed(case: AnsweredCase) -> bool:
    """Return whether a case counts as a miss: a false alarm, or, where visible, a wrong class or
    `unknown` not said.
    """
    if case.kind == CLEAN:
        return bool(case.verdict) or case.answer is None
    if case.kind == OUT_OF_LIBRARY:
        return (case.visible and UNKNOWN not in case.verdict) or wrong_and_sure(case)
    return case.visible and not right_class(case)
