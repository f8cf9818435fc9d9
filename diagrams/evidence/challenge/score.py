"""Scores answers to a challenge set against its truth: a pure function of the two."""

import math
import re
from collections import Counter
from collections.abc import Sequence
from functools import reduce
from itertools import chain, groupby
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import scipy

from diagrams.batch.run import Table
from diagrams.evidence.challenge.answers import AnsweredCase
from diagrams.evidence.challenge.case import CLEAN, OUT_OF_LIBRARY
from diagrams.evidence.challenge.truth import NO_GAP
from diagrams.evidence.scoring import (
    SURE,
    aggregate,
    at,
    binned,
    listed,
    median,
    share,
    table,
    written,
)
from np_drake.diagnosis.result import UNKNOWN
from np_drake.effects.base import Parameter
from np_drake.effects.library import LIBRARY, MEASURED_ROTORS
from np_drake.files.yaml_file import read_yaml

SCORE = read_yaml(Path(__file__).with_suffix(".yaml"))
WIDEST = 3  # names that a class may hold, that of its cause included: more tell nothing
# a wind acts through a drag
WINDS = {"constant_wind", "gusty_wind"}
COMPANION = {"linear_drag"}
GUSTS = "gusty_wind"


# Identification of one case


def matches(case: AnsweredCase) -> dict[int, str]:
    """Return true effect number -> cause that stands for it; as many as possible, each cause once,
    right names first.
    """
    named = case.named
    if not named or not case.true_names:
        return {}
    # Largest total worth of an assignment: a match counts 1, a cause of the effect's name a
    # hundredth more.
    worth = np.array(
        [
            [_stands_for(case, i, name) * (1.0 + 0.01 * (name == true)) for name in named]
            for i, true in enumerate(case.true_names)
        ]
    )
    pairs = zip(*scipy.optimize.linear_sum_assignment(worth, maximize=True), strict=True)
    return {int(i): named[j] for i, j in pairs if worth[i, j] > 0}


def _stands_for(case: AnsweredCase, true: int, name: str) -> bool:
    """Return whether the cause `name` stands for true effect number `true`; too wide a class stands
    for none.
    """
    alike = {name, *case.causes.get(name, {}).get("indistinguishable_from", ())}
    return len(alike) <= WIDEST and (
        name in case.truth["class"][true] or case.true_names[true] in alike
    )


def outcome(case: AnsweredCase) -> dict[str, Any]:
    """Return all that counts of one case: what a score shows of it, up to `LAST_SHOWN`, and the
    rest.
    """
    matched = matches(case)
    verdict = set(case.verdict)
    acting = set(case.true_names)
    # By true effect its name and those that are physically the same.
    same = [
        {*names, name} for names, name in zip(case.truth["class"], case.true_names, strict=True)
    ]
    true = set().union(*same)
    names = [(n, case.causes.get(n, {}).get("probability"), n in true) for n in case.named]
    unknown = UNKNOWN in verdict
    missing = len(case.true_names) - len(matched)
    all_named = len(matched) == len(case.named) and not missing
    sure = any((p or 0.0) > SURE and not right for _, p, right in names)
    alarm = bool(verdict) or case.answer is None
    right = all_named and not unknown
    missed = {CLEAN: alarm, OUT_OF_LIBRARY: (case.visible and not unknown) or sure}.get(
        case.kind, case.visible and not right
    )
    answer = case.answer or {}
    felt = case.truth.get("visibility_in_training", {})
    spare = COMPANION if WINDS & acting else set()
    replay = replay_reduction(case)
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
        "exact": verdict == acting,
        "right_class": right,
        "matched": sorted(set(matched.values())),
        "missed": missed,
        "onset": onset_errors(case),
        "shrink_relative": relative_gap_reduction(case),
        "replay_reduction": replay,
        "quality": str(case.truth["quality"]),
        "seed": int(case.truth["seed"]),
        "known": case.kind not in (CLEAN, OUT_OF_LIBRARY),
        "calm": GUSTS not in case.true_names,
        "least": case.least,
        "visible": case.visible,
        "felt": max(felt.values(), default=0.0) >= case.least,
        # The training flights tell every true effect from all others but a few.
        "tellable": all(len(names) <= WIDEST for names in same),
        "class_unknown_allowed": all_named,
        "exact_lenient": verdict - spare == acting - spare,
        "detected": 0 in matched,
        "alarm": alarm,
        "named": bool(case.named),
        "unknown": unknown,
        "alone": case.verdict == (UNKNOWN,),
        "wrong_and_sure": sure,
        "acting": len(case.true_names),
        "together": " + ".join(case.true_names),
        "main": next(iter(case.true_names), ""),
        "counts": (len(matched), len(case.verdict) - len(matched), missing),
        "judged": names,
        "errors": errors_of(case),
        "replay_worse": None if replay is None else replay < 0,
        "joined": bool(answer.get("joined")),
        "wall": answer.get("wall"),
    }


LAST_SHOWN = "replay_reduction"


# Parameters and onsets of one case

SMALL = 0.1  # of a parameter's typical size: errors are not measured against less
# The effect vanishes at no value of these: their error is relative to the value itself.
ABSOLUTE = {("suspended_payload", "length"), ("gusty_wind", "correlation_time")}
PLACE = "hook"  # a vector of no natural scale: its error stays in [m]
AXIS = re.compile(r"(?:(?P<stem>.+)_)?(xx|yy|zz|x|y|z)")
ANGLES = ("roll", "pitch", "yaw")
ERROR = ["effect", "parameter", "size", "kind", "inside", "empty"]


def errors_of(case: AnsweredCase) -> list[tuple]:
    """Return (effect, parameter, size, kind, inside, empty) of every parameter, or vector of them,
    of every effect that is named by its right name.

    size: relative [1], of a place [m], of a choice 0 or 1. inside: by scalar, whether its interval
    holds the truth. empty: intervals of no width.
    """
    errors = []
    for effect in case.truth["effects"]:
        name = effect["effect"]
        true = effect["parameters"]
        if name in case.named and name in LIBRARY and name in case.causes:
            given = case.causes[name]["parameters"]
            known = [p for p in LIBRARY[name].parameters if p.name in true and p.name in given]
            for vector, parameters in groupby(known, key=lambda p: group_of(p.name)):
                errors.append((name, vector, *_error(name, vector, list(parameters), true, given)))
    return errors


def group_of(name: str) -> str:
    """Return the vector that a parameter is part of, else its name: x -> vector, d_x -> d, roll ->
    angles.
    """
    axis = AXIS.fullmatch(name)
    vector = name if axis is None else (axis["stem"] or "vector")
    return "angles" if name in ANGLES else vector


def _error(
    effect: str, name: str, group: list[Parameter], true: dict[str, float], given: dict[str, Any]
) -> tuple[float, str, tuple[bool, ...], int]:
    real = np.array([true[p.name] for p in group], float)
    value = np.array([given[p.name]["value"] for p in group], float)  # NaN where there is none
    if group[0].choices:
        return float(not np.array_equal(real, np.round(value))), "choice", (), 0
    low, high = np.array([given[p.name]["ci95"] for p in group], float).T
    inside = tuple((low <= real) & (real <= high))
    empty = int(np.sum(low == high))
    size = float(np.linalg.norm(value - real))
    if name == PLACE:
        return size, "place", inside, empty
    # From where the effect vanishes to the truth, but no less than `SMALL`.
    neutral = np.array([0.0 if (effect, p.name) in ABSOLUTE else p.neutral for p in group])
    least = SMALL * float(np.linalg.norm([p.typical for p in group]))
    scale = max(float(np.linalg.norm(real - neutral)), least)
    return size / scale, "relative", inside, empty


TOLERANCE = 0.2  # [s]
ONSET = ["flight", "named", "error", "visibility"]


def same_flight(name: str) -> str:
    """Return a flight's name without folder and suffix: `train_1.csv` and `train_1` are one
    flight.
    """
    return re.sub(r"\.(csv\.gz|csv|parquet)$", "", name.rsplit("/", 1)[-1])


def onset_errors(case: AnsweredCase) -> list[dict[str, Any]]:
    """Return a row a flight and instant: error [s], None where no cause with an onset stands for
    what begins there.

    What begins together (a wind and its drag) counts once, by the one that is worst.
    """
    matched = matches(case)
    seen = case.truth.get("visibility_in_training", {})
    rows: dict[tuple[str, float], dict[str, Any]] = {}
    for i, effect in enumerate(case.truth["effects"]):
        cause = case.causes.get(matched[i]) if i in matched else None
        estimates = {same_flight(f): t for f, t in (cause or {}).get("onset", {}).items()}
        for flight, true in (effect.get("onset") or {}).items():
            if true is None:
                continue
            given = estimates.get(same_flight(flight))
            row = {
                "flight": flight,
                "named": cause is not None,
                "error": None if given is None else given - true,
                "visibility": float(seen.get(flight, case.visibility)),
            }
            rows[flight, true] = max(rows.get((flight, true), row), row, key=_badness)
    return list(rows.values())


def _badness(row: dict[str, Any]) -> tuple[bool, float]:
    """Return how bad an onset is: not named, and by how much it is off [s]."""
    return not row["named"], math.inf if row["error"] is None else abs(row["error"])


# Reduction of the gap, and of the error of the replay

HORIZON = 1.0  # of the replay [s]


def relative_gap_reduction(case: AnsweredCase) -> float | None:
    """Return 1 - (after² - 1) / (before² - 1), clipped to [-1, 1]: the true model has 1; None where
    there is no gap.

    before, after: held-out residual in units of what the true model leaves, pooled over wrench
    channels [1].
    """
    gap = (case.answer or {}).get("gap", {})
    residual = case.truth["true_model_residual"]
    channels = [(kind, axis) for kind in ("force", "torque") for axis in "xyz"]
    rms = [[gap.get(k, {}).get(a, {}).get(key) for k, a in channels] for key in ("rms", "after")]
    errors = np.array(rms, float)
    floors = np.array([residual[f"{k}_{a}"] for k, a in channels])
    if case.kind == CLEAN or np.isnan(errors).any() or floors.min() <= 0:
        return None
    before, after = np.sqrt(np.mean((errors / floors) ** 2, axis=1))
    cut = 1 - (after**2 - 1) / (before**2 - 1) if before >= NO_GAP else math.nan
    return None if math.isnan(cut) else float(np.clip(cut, -1.0, 1.0))


def replay_reduction(case: AnsweredCase) -> float | None:
    """Return 1 - after / before of the position error of the replay at `HORIZON`; None without both
    errors.
    """
    replay = (case.answer or {}).get("shrink", {}).get("replay") or {}
    before, after = (
        dict(zip(replay["horizon"], errors["position"], strict=False)).get(HORIZON)
        if (errors := replay.get(name))
        else None
        for name in ("before", "after")
    )
    return float(1 - after / before) if before and after is not None and before > 0 else None


# Detection against visibility: a logistic curve with bins

FAINTEST = 1e-3  # visibility - 1 below which all is as invisible [1]
VISIBILITIES = (1.0, 1.03, 1.1, 1.3, 1.5, 2.0, 3.0, 5.0, 10.0, np.inf)  # edges of bins [1]
DRAWS = 400
PRIOR = 0.05  # weight of the penalty that keeps the curve finite where the classes part
ENOUGH = 8  # cases for a curve


def logistic(visibility: np.ndarray, detected: np.ndarray, steps: int = 60) -> tuple[float, float]:
    """Fit intercept a and slope b of P(detected) = expit(a + b x), lightly penalised, where x =
    log10(visibility - 1).

    visibility, detected: (n,), detected 0 or 1. Source of x: own choice: effects come by decades.
    """
    x = np.log10(np.maximum(visibility - 1.0, FAINTEST))
    # Newton's method on the ridge-penalised log-likelihood (iteratively reweighted least squares),
    # steps limited to 2.
    design = np.stack([np.ones_like(x), x], axis=1)
    penalty = PRIOR * np.eye(2)
    theta = np.zeros(2)
    for _ in range(steps):
        p = scipy.special.expit(design @ theta)
        gradient = design.T @ (detected - p) - penalty @ theta
        curvature = (design * (p * (1 - p))[:, None]).T @ design + penalty
        step = np.linalg.solve(curvature, gradient)
        theta = theta + step / max(1.0, float(np.abs(step).max()) / 2.0)
    return float(theta[0]), float(theta[1])


def half_found(curve: tuple[float, float]) -> float | None:
    """Return the visibility at which half are found; None where the curve does not rise."""
    intercept, slope = curve
    return None if slope <= 0 else float(1.0 + 10.0 ** np.clip(-intercept / slope, -6.0, 6.0))


def detection(
    visibility: Sequence[float], detected: Sequence[bool], seed: int = 0
) -> dict[str, Any]:
    """Return points, bins, curve (intercept, slope), and visibility of half with its 95 % interval
    (bootstrap over cases).
    """
    points = pd.DataFrame({"visibility": visibility, "found": detected}).reset_index(drop=True)
    x = points["visibility"].to_numpy(float)
    y = points["found"].to_numpy(float)
    bins = binned(
        points["visibility"].clip(1.0), points["found"], VISIBILITIES, "median", closed="left"
    )
    result = {"n": len(x), **points.to_dict("list"), "bins": bins}
    if len(x) < ENOUGH:
        return {**result, "curve": None, "half": None, "half_ci95": None}
    curve = logistic(x, y)
    rng = np.random.default_rng(seed)
    picks = (rng.integers(0, len(x), len(x)) for _ in range(DRAWS))
    drawn = pd.Series([half_found(logistic(x[pick], y[pick], 25)) for pick in picks], dtype=float)
    interval = drawn.quantile([0.025, 0.975]).tolist() if drawn.notna().any() else None
    return {**result, "curve": list(curve), "half": half_found(curve), "half_ci95": interval}


# The whole set


def score(cases: Sequence[AnsweredCase], *, seed: int = 0) -> dict[str, Any]:
    """Return all metrics; where the set mixes them also by simulator and quality (`groups`) and by
    quality.
    """
    rows = pd.DataFrame([outcome(case) for case in cases])
    groups, qualities = (dict(iter(rows.groupby(k))) for k in ("group", "quality"))
    without = rows["case"][~rows["answered"]].tolist()
    lost = f"{len(without)} cases have no answer and count as misses: {', '.join(without[:5])}"
    parts = {
        "groups": groups if len(groups) > 1 else {},
        "qualities": qualities if len(groups) > len(qualities) else {},
    }
    return {
        **metrics(rows, seed),
        **{key: {n: metrics(of, seed) for n, of in part.items()} for key, part in parts.items()},
        "sets": [
            {"group": name, "cases": len(of), "seeds": sorted(set(of["seed"]))}
            for name, of in groups.items()
        ],
        "warnings": [lost] if without else [],
        "cases": rows.loc[:, :LAST_SHOWN].to_dict("records"),  # type: ignore[misc]
    }


def metrics(rows: pd.DataFrame, seed: int = 0) -> dict[str, Any]:
    """Return all metrics of cases that are taken together: those of `score.yaml`, the curve of
    detection, and rows by effect.

    rows: of `outcome`.
    """
    errors = listed(rows, "errors", ERROR)
    onsets = listed(rows, "onset", ONSET)
    size = onsets["error"].astype(float).abs()
    frames = {
        "cases": rows,
        "errors": errors.assign(
            exact=errors["size"] == 0.0, effect=pd.Categorical(errors["effect"], list(LIBRARY))
        ),
        "onset": onsets.assign(size=size, within=size <= TOLERANCE),
    }

    def counted(name: str) -> pd.DataFrame:
        of = SCORE["cases"][name]
        frame = frames[of.get("rows", "cases")]
        return frame.query(of["where"]) if "where" in of else frame

    result: dict[str, Any] = {"replay": {"horizon": HORIZON}}
    for line in SCORE["figures"]:
        *sections, name = line["key"].split(".")
        section = reduce(lambda parent, key: parent.setdefault(key, {}), sections, result)
        section[name] = aggregate(counted(line["of"]), line)
    begun = rows[rows["kind"].isin(("single", "onset"))]
    begun = begun.sort_values("kind", ascending=False, kind="stable")
    return {
        **result,
        "detection": detection(begun["visibility"], begun["detected"], seed),
        "effects": _effect_rows(rows, counted("parameters")),
    }


def _effect_rows(rows: pd.DataFrame, errors: pd.DataFrame) -> list[dict[str, Any]]:
    """Return, by effect of the library that acts or is named in the set, how it is detected,
    misnamed and estimated.
    """
    seen = {*chain(*rows["true"], *rows["verdict"])}
    alone = rows[rows["visible"] & rows["kind"].isin(("single", "onset"))]
    wrong = Counter(name for name, _, true in chain(*rows["judged"]) if not true)
    result = []
    for name in (name for name in LIBRARY | MEASURED_ROTORS if name in seen):
        acting = alone[alone["main"] == name]
        estimated = errors[errors["effect"] == name]
        result.append(
            {
                "effect": name,
                "n": len(acting),
                "detected": share(acting["detected"]),
                "exact": share(acting["exact_lenient"]),
                "named_wrongly": wrong[name],
                "median_error": median(estimated["size"][estimated["kind"] == "relative"]),
                "coverage": share(estimated["inside"]),
            }
        )
    return result


# Tables


def tables(score: dict[str, Any], least: float) -> list[Table]:
    """Return the tables worth printing: metrics by quality where a set mixes simulators, metrics by
    set, what is detected by visibility, effects.

    least: visibility from which its cases count as visible [1].
    """
    all_cases = "all" if score["groups"] else score["sets"][0]["group"]
    sure = f"≥ {least:g}"
    parts = [part for part in (score["qualities"], {all_cases: score, **score["groups"]}) if part]
    bins: dict[float, dict[str, Any]] = {}
    for name, of in parts[0].items():
        for row in of["detection"]["bins"]:
            edges = f"{row['lower']:g} … {row['upper']:g}"
            bins.setdefault(row["lower"], {"visibility": edges})[name] = row
    metrics = (
        [
            {"figure": label.format(least=sure), **{n: at(of, keys) for n, of in part.items()}}
            for label, keys in SCORE["shown"]
        ]
        for part in parts
    )
    title = f"score: [95 % interval], cases; ({sure}): of that visibility; shrink: true model = 1"
    return [
        *(shown for lines in metrics for shown in table(title, lines)),
        *table(
            "single effects found, from the start or begun in flight",
            (bins[edge] for edge in sorted(bins)),
        ),
        *table(f"effects, cases of one with visibility {sure}", score["effects"]),
        *table(
            f"foreign effects with visibility {sure}",
            (
                {**row, "named": ", ".join(f"{n} {times}" for n, times in row["named"].items())}
                for row in score["rates"]["foreign"]["kinds"]
            ),
        ),
    ]


def missed(score: dict[str, Any]) -> list[Table]:
    """Return every miss that counts: what acts, how visible, and the verdict with its
    probabilities.
    """
    lines = [
        {
            **{key: row[key] for key in ("case", "kind", "visibility")},
            "truth": ", ".join(row["true"]) or "nothing",
            "verdict": ", ".join(
                f"{name} {written(row['probability'].get(name))}" for name in row["verdict"]
            )
            or ("nothing" if row["answered"] else "no answer"),
            "shrink": row["shrink_relative"],
        }
        for row in score["cases"]
        if row["missed"]
    ]
    return table("misses", lines)
