"""Scores answers to a challenge set against its truth: a pure function of the two."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

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
    effect_counts,
    exact,
    identifiable_in_training,
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

VISIBLE = 1.5  # least visibility of cases that count as visible [1]
SEED = 0  # of the bootstrap
GUSTS = "gusty_wind"


def score(cases: Sequence[AnsweredCase], *, least: float = VISIBLE, seed: int = SEED) -> dict[str, Any]:
    """Return all metrics; where the set mixes them also by simulator and quality (`groups`) and by quality.

    Args: least: visibility from which a case counts as visible [1].
    """
    whole = score_group(cases, least=least, seed=seed)
    parts = parts_by(cases, lambda case: case.group)
    qualities = parts_by(cases, lambda case: str(case.truth["quality"]))
    mixed = {
        "groups": parts if len(parts) > 1 else {},
        "qualities": qualities if len(parts) > len(qualities) else {},
    }
    for key, some in mixed.items():
        whole[key] = {name: score_group(part, least=least, seed=seed) for name, part in some.items()}
    whole["sets"] = [
        {"group": name, "cases": len(part), "seeds": sorted({int(case.truth["seed"]) for case in part})}
        for name, part in parts.items()
    ]
    whole["warnings"] = warnings(cases)
    whole["cases"] = [case_row(case, least) for case in cases]
    return whole


def parts_by(
    cases: Sequence[AnsweredCase], key: Callable[[AnsweredCase], str]
) -> dict[str, list[AnsweredCase]]:
    """Return the cases by key, sorted by it."""
    return {name: [c for c in cases if key(c) == name] for name in sorted({key(c) for c in cases})}


def score_group(cases: Sequence[AnsweredCase], *, least: float, seed: int) -> dict[str, Any]:
    """Return all metrics of cases that are taken together."""
    kinds = {kind: [c for c in cases if c.kind == kind] for kind in ("single", "onset", "clean", "foreign")}
    many = [c for c in cases if c.kind in ("pair", "triple")]
    visible = [c for c in cases if c.visibility >= least]
    known = [c for c in cases if c.kind not in ("clean", "foreign")]
    rates = {
        "single": singles([c for c in visible if c.kind == "single"]),
        "single_felt": singles(
            [c for c in visible if c.kind == "single" and c.visibility_in_training >= least]
        ),
        "single_tellable": singles(
            [c for c in visible if c.kind == "single" and identifiable_in_training(c)]
        ),
        "onset": singles([c for c in visible if c.kind == "onset"]),
        "pair": several([c for c in many if c.kind == "pair"], least),
        "triple": several([c for c in many if c.kind == "triple"], least),
        "several": several(many, least),
        "clean": clean(kinds["clean"]),
        "foreign": out_of_library(kinds["foreign"], least),
    }
    errors = [error for c in known if c.visibility >= least for error in errors_of(c)]
    return {
        "accuracy": accuracy(rates),
        "rates": rates,
        "parameters": parameters_of(errors),
        "onset": onset_summary(known, least),
        "shrink_relative": gap_reduction_summary(known),
        "shrink_relative_parameters": gap_reduction_summary(known, PARAMETERS),
        "shrink_relative_calm": gap_reduction_summary([c for c in known if GUSTS not in c.true_names]),
        "shrink_relative_foreign": gap_reduction_summary(kinds["foreign"]),
        "replay": replay_summary(known, least),
        "detection": detection([*kinds["single"], *kinds["onset"]], seed),
        "reliability": reliability(cases),
        "effects": effect_rows(cases, errors, least),
        "confusion": confusion(cases, least),
        "second_look": binomial_interval(bool(c.answer.get("joined")) for c in cases if c.answer is not None),
        "wall": median(c.answer.get("wall") for c in cases if c.answer is not None),
    }


def accuracy(rates: dict[str, Any]) -> dict[str, Any]:
    """Return plain numbers: share of visible singles with the right class and name, F1 of pairs, and so on."""
    return {
        "single": rates["single"]["class"]["rate"],
        "single_exact": rates["single"]["exact"]["rate"],
        "pair": rates["pair"]["all"]["f1"],
        "triple": rates["triple"]["all"]["f1"],
        "clean_false_alarm": rates["clean"]["false_alarm"]["rate"],
        "unknown": rates["foreign"]["unknown"]["rate"],
    }


def parameters_of(errors: Sequence[ParameterError]) -> dict[str, Any]:
    """Return a summary, `coverage` as a plain number, and a row a parameter."""
    found = parameter_summary(errors)
    return {
        **found,
        "coverage": found["coverage"]["rate"],
        "coverage_rate": found["coverage"],
        "rows": by_parameter(errors),
    }


def effect_rows(
    cases: Sequence[AnsweredCase], errors: Sequence[ParameterError], least: float
) -> list[dict[str, Any]]:
    """Return a row an effect of the library that acts or is named in the set."""
    seen = {name for c in cases for name in (*c.true_names, *c.verdict)}
    rows = []
    for name in (n for n in LIBRARY | MEASURED_ROTORS if n in seen):
        found = parameter_summary(e for e in errors if e.effect == name)
        estimated = {key: found[key] for key in ("median_error", "coverage")}
        rows.append({"effect": name, **effect_counts(name, cases, least), **estimated})
    return rows


def case_row(case: AnsweredCase, least: float) -> dict[str, Any]:
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
        "missed": missed(case, least),
        "onset": onset_errors(case),
        "shrink_relative": relative_gap_reduction(case),
        "replay_reduction": replay_reduction(case),
    }


def missed(case: AnsweredCase, least: float) -> bool:
    """Return whether a case counts as a miss: a false alarm, or, where visible, a wrong class or `unknown` not said."""
    if case.kind == "clean":
        return bool(case.verdict) or case.answer is None
    if case.kind == "foreign":
        silent = UNKNOWN not in case.verdict and case.visibility >= least
        return silent or bool(wrong_and_sure(case))
    return case.visibility >= least and not right_class(case)


def warnings(cases: Iterable[AnsweredCase]) -> list[str]:
    """Return one line for cases without an answer."""
    without = [case.name for case in cases if case.answer is None]
    if not without:
        return []
    return [f"{len(without)} cases have no answer and count as misses: {', '.join(without[:5])}"]
