"""Scores answers to a challenge set against its truth: a pure function of the two."""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import chain, groupby
from typing import Any

import numpy as np
import pandas as pd
import scipy

from diagrams.evidence.challenge.answers import AnsweredCase
from diagrams.evidence.challenge.case import CLEAN, OUT_OF_LIBRARY
from diagrams.evidence.challenge.truth import NO_GAP
from np_drake.diagnosis.result import UNKNOWN
from np_drake.effects.base import Parameter
from np_drake.effects.library import LIBRARY, MEASURED_ROTORS

WIDEST = 3  # names that a class may hold, a cause's own included: more tell nothing
SURE = 0.9  # probability of a cause above which a wrong name counts as a claim
# a wind acts through a drag
WINDS = {"constant_wind", "gusty_wind"}
COMPANION = {"linear_drag"}
GUSTS = "gusty_wind"
PROBABILITIES = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0)  # edges of bins [1]


# Shares and other statistics


def share(outcomes: Iterable[bool]) -> dict[str, Any]:
    """Return {"count", "n", "rate", "ci95"} of outcomes; the rate of none is None.

    ci95: the exact binomial interval of Clopper and Pearson.
    """
    values = [bool(outcome) for outcome in outcomes]
    k = sum(values)
    n = len(values)
    if not n:
        return {"count": 0, "n": 0, "rate": None, "ci95": [0.0, 1.0]}
    interval = scipy.stats.binomtest(k, n).proportion_ci()
    return {"count": k, "n": n, "rate": k / n, "ci95": [float(interval.low), float(interval.high)]}


def shares(rows: pd.DataFrame, columns: dict[str, str]) -> dict[str, Any]:
    """Return the shares of columns of rows, by the names given to them."""
    return {name: share(rows[column]) for name, column in columns.items()}


def finite(values: Iterable[float | None]) -> list[float]:
    """Return the values that are there and finite."""
    return [v for v in values if v is not None and np.isfinite(v)]


def median(values: Iterable[float | None]) -> float | None:
    """Return the median of the finite values; None where there are none."""
    known = finite(values)
    return float(np.median(known)) if known else None


def binned(
    outcomes: np.ndarray,
    values: np.ndarray,
    edges: Sequence[float],
    statistic: Callable,
    *,
    side: str = "right",
) -> list[dict[str, Any]]:
    """Return the share of outcomes by bin of values, with edges and `statistic` (`mean` | `median`)
    of the values; empty bins are left out.

    side: `left`: upper edges belong to a bin.
    """
    place = np.clip(np.searchsorted(edges, values, side=side) - 1, 0, len(edges) - 2)  # type: ignore[call-overload]
    return [
        {
            "lower": edges[k],
            "upper": edges[k + 1],
            statistic.__name__: float(statistic(values[place == k])),
            **share(outcomes[place == k]),
        }
        for k in np.unique(place)
    ]


def calibration(
    pairs: Sequence[tuple[float, bool]], edges: Sequence[float] = PROBABILITIES, side: str = "left"
) -> dict[str, Any]:
    """Return reported probabilities against whether they are true, by bin.

    brier: mean square of probability minus outcome.
    ece: mean of |share right - mean probability| over bins, weighted by count.
    """
    if not pairs:
        return {"n": 0, "bins": [], "brier": None, "ece": None}
    p, right = (np.array(column, float) for column in zip(*pairs, strict=True))
    rows = binned(right > 0, p, edges, np.mean, side=side)
    return {
        "n": len(pairs),
        "bins": rows,
        "brier": float(np.mean((p - right) ** 2)),
        "ece": sum(row["n"] * abs(row["rate"] - row["mean"]) for row in rows) / len(pairs),
    }


def precision_and_recall(counts: Iterable[tuple[int, int, int]]) -> dict[str, Any]:
    """Return precision, recall and F1, pooled over cases of (right, too many, missing); None where
    undefined.
    """
    table = np.reshape(list(counts), (-1, 3))
    right, extra, missing = (int(total) for total in table.sum(axis=0))
    of = {
        "precision": right + extra,
        "recall": right + missing,
        "f1": right + (extra + missing) / 2,
    }
    ratios = {name: right / whole if whole else None for name, whole in of.items()}
    return {"cases": len(table), "right": right, "extra": extra, "missing": missing, **ratios}


# Identification of one case


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
    pairs = zip(*scipy.optimize.linear_sum_assignment(worth, maximize=True), strict=True)
    return {int(i): named[j] for i, j in pairs if worth[i, j] > 0}


def _stands_for(case: AnsweredCase, true: int, name: str) -> bool:
    """Return whether the cause `name` stands for true effect number `true`; too wide a class stands
    for none.
    """
    own = (name, *case.causes.get(name, {}).get("indistinguishable_from", ()))
    return len(set(own)) <= WIDEST and (
        name in case.truth["class"][true] or case.true_names[true] in own
    )


def outcome(case: AnsweredCase) -> dict[str, Any]:
    """Return all that counts of one case: what a score shows of it, up to `LAST_SHOWN`, and the
    rest.
    """
    found = matches(case)
    verdict = set(case.verdict)
    acting = set(case.true_names)
    # By true effect its own name and those that are physically the same.
    same = [{true, *own} for true, own in zip(case.true_names, case.truth["class"], strict=True)]
    true = set().union(*same)
    names = [(n, case.causes.get(n, {}).get("probability"), n in true) for n in case.named]
    unknown = UNKNOWN in verdict
    missing = len(case.true_names) - len(found)
    all_named = len(found) == len(case.named) and not missing
    sure = any((p or 0.0) > SURE and not right for _, p, right in names)
    alarm = bool(verdict) or case.answer is None
    right = all_named and not unknown
    missed = {CLEAN: alarm, OUT_OF_LIBRARY: (case.visible and not unknown) or sure}.get(
        case.kind, case.visible and not right
    )
    said = case.answer or {}
    felt = case.truth.get("visibility_in_training", {})
    spare = COMPANION if WINDS & acting else set()
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
        "matched": sorted(set(found.values())),
        "missed": missed,
        "onset": onset_errors(case),
        "shrink_relative": relative_gap_reduction(case),
        "replay_reduction": replay_reduction(case),
        "quality": str(case.truth["quality"]),
        "seed": int(case.truth["seed"]),
        "least": case.least,
        "visible": case.visible,
        "felt": max(felt.values(), default=0.0) >= case.least,
        # The training flights tell every true effect from all others but a few.
        "tellable": all(len(own) <= WIDEST for own in same),
        "class_unknown_allowed": all_named,
        "exact_lenient": verdict - spare == acting - spare,
        "detected": 0 in found,
        "alarm": alarm,
        "named": bool(case.named),
        "unknown": unknown,
        "alone": case.verdict == (UNKNOWN,),
        "wrong_and_sure": sure,
        "together": " + ".join(case.true_names),
        "main": next(iter(case.true_names), ""),
        "counts": (len(found), len(case.verdict) - len(found), missing),
        "judged": names,
        "errors": errors_of(case),
        "joined": bool(said.get("joined")),
        "wall": said.get("wall"),
    }


LAST_SHOWN = "replay_reduction"
SINGLES = {
    "class": "right_class",
    "class_unknown_allowed": "class_unknown_allowed",
    "exact": "exact",
    "exact_lenient": "exact_lenient",
    "detected": "detected",
}
FOREIGN = {"unknown": "unknown", "alone": "alone", "wrong_and_sure": "wrong_and_sure"}


# Parameters and onsets of one case

SMALL = 0.1  # of a parameter's typical size: errors are not measured against less
# The effect vanishes at no value of these: their error is relative to the value itself.
ABSOLUTE = {("suspended_payload", "length"), ("gusty_wind", "correlation_time")}
PLACE = "hook"  # a vector of no natural scale: its error stays in [m]
AXIS = re.compile(r"(?:(?P<stem>.+)_)?(xx|yy|zz|x|y|z)")
ANGLES = ("roll", "pitch", "yaw")
ERROR = ("effect", "parameter", "size", "kind", "inside", "empty")


def errors_of(case: AnsweredCase) -> list[tuple]:
    """Return (effect, parameter, size, kind, inside, empty) of every parameter, or vector of them,
    of every effect that is named by its right name.

    size: relative [1], of a place [m], of a choice 0 or 1. inside: by scalar, whether its interval
    holds the truth. empty: intervals of no width.
    """
    found = []
    for effect in case.truth["effects"]:
        name = effect["effect"]
        true = effect["parameters"]
        if name in case.named and name in LIBRARY and name in case.causes:
            given = case.causes[name]["parameters"]
            known = [p for p in LIBRARY[name].parameters if p.name in true and p.name in given]
            vectors = groupby(known, key=lambda p: group_of(p.name))
            found += [_error(name, vector, list(own), true, given) for vector, own in vectors]
    return found


def group_of(name: str) -> str:
    """Return the vector that a parameter is part of, else its own name: x -> vector, d_x -> d, roll
    -> angles.
    """
    axis = AXIS.fullmatch(name)
    own = name if axis is None else (axis["stem"] or "vector")
    return "angles" if name in ANGLES else own


def _error(
    effect: str, name: str, group: list[Parameter], true: dict[str, float], given: dict[str, Any]
) -> tuple:
    real = np.array([true[p.name] for p in group], float)
    value = np.array([given[p.name]["value"] for p in group], float)  # NaN where there is none
    if group[0].choices:
        return effect, name, float(not np.array_equal(real, np.round(value))), "choice", (), 0
    low, high = np.array([given[p.name]["ci95"] for p in group], float).T
    inside = tuple((low <= real) & (real <= high))
    empty = int(np.sum(low == high))
    size = float(np.linalg.norm(value - real))
    if name == PLACE:
        return effect, name, size, "place", inside, empty
    # From where the effect vanishes to the truth, but no less than `SMALL`.
    neutral = np.array([0.0 if (effect, p.name) in ABSOLUTE else p.neutral for p in group])
    least = SMALL * float(np.linalg.norm([p.typical for p in group]))
    scale = max(float(np.linalg.norm(real - neutral)), least)
    return effect, name, size / scale, "relative", inside, empty


def parameter_summary(errors: pd.DataFrame) -> dict[str, Any]:
    """Return median errors, coverage of intervals, choices that are right, and a row a parameter or
    vector of every effect.
    """
    sizes = {kind: errors["size"][errors["kind"] == kind] for kind in ("relative", "place")}
    held = share(errors["inside"].explode().dropna())
    rows = [
        {
            "effect": effect,
            "parameter": parameter,
            "kind": own["kind"].iloc[0],
            "n": len(own),
            "median_error": median(own["size"]),
            "coverage": share(own["inside"].explode().dropna()),
        }
        for (effect, parameter), own in errors.groupby(["effect", "parameter"])
    ]
    return {
        "n": len(errors),
        "median_error": median(sizes["relative"]),
        "coverage": held["rate"],
        "intervals_without_width": int(errors["empty"].sum()),
        "place_error": median(sizes["place"]),
        "choice": share(errors["size"][errors["kind"] == "choice"] == 0.0),
        "coverage_rate": held,
        "rows": sorted(rows, key=lambda row: list(LIBRARY).index(row["effect"])),
    }


TOLERANCE = 0.2  # [s]


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
    found = matches(case)
    seen = case.truth.get("visibility_in_training", {})
    rows: dict[tuple[str, float], dict[str, Any]] = {}
    for i, effect in enumerate(case.truth["effects"]):
        cause = case.causes.get(found[i]) if i in found else None
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
            rows[flight, true] = max(
                rows.get((flight, true), row), row, key=lambda row: (not row["named"], off(row))
            )
    return list(rows.values())


def off(row: dict[str, Any]) -> float:
    """Return by how much an onset is off, infinite where none is given [s]."""
    return math.inf if row["error"] is None else abs(row["error"])


def onset_summary(known: pd.DataFrame) -> dict[str, Any]:
    """Return the share of flights with the right onset, and the median error [s].

    within: of visible cases; within_all: of all; within_if_named: whose effect is named;
    within_if_seen: in which it is visible.
    """
    every = [(case, row) for case in known.itertuples() for row in case.onset]
    rows = [row for case, row in every if case.visible]
    seen = [row for case, row in every if case.visible and row["visibility"] >= case.least]

    def within(some: Iterable[dict[str, Any]]) -> dict[str, Any]:
        return share(off(row) <= TOLERANCE for row in some)

    return {
        "within": within(rows),
        "within_all": within(row for _, row in every),
        "within_if_named": within(row for row in rows if row["named"]),
        "within_if_seen": within(seen),
        "median_error": median(map(off, rows)),
    }


# Reduction of the gap, and of the error of the replay

HORIZON = 1.0  # of the replay [s]


def relative_gap_reduction(case: AnsweredCase) -> float | None:
    """Return 1 - (after² - 1) / (before² - 1), clipped to [-1, 1]: the true model has 1; None where
    there is no gap.

    before, after: held-out residual in units of what the true model leaves, pooled over wrench
    channels [1].
    """
    gap = (case.answer or {}).get("gap", {})
    left = case.truth["true_model_residual"]
    channels = [(kind, axis) for kind in ("force", "torque") for axis in "xyz"]
    rms = [[gap.get(k, {}).get(a, {}).get(key) for k, a in channels] for key in ("rms", "after")]
    errors = np.array(rms, float)
    floors = np.array([left[f"{k}_{a}"] for k, a in channels])
    if case.kind == CLEAN or np.isnan(errors).any() or floors.min() <= 0:
        return None
    before, after = np.sqrt(np.mean((errors / floors) ** 2, axis=1))
    cut = 1 - (after**2 - 1) / (before**2 - 1) if before >= NO_GAP else math.nan
    return None if math.isnan(cut) else float(np.clip(cut, -1.0, 1.0))


def gap_reduction_summary(values: Iterable[float | None]) -> dict[str, Any]:
    """Return count, mean and median of the reduction over cases with a visible gap."""
    known = finite(values)
    return {
        "n": len(known),
        "mean": float(np.mean(known)) if known else None,
        "median": median(known),
    }


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


def logistic(visibility: np.ndarray, found: np.ndarray, steps: int = 60) -> tuple[float, float]:
    """Fit intercept a and slope b of P(found) = expit(a + b x), lightly penalised, where x =
    log10(visibility - 1).

    visibility, found: (n,), found 0 or 1. Source of x: own choice: effects come by decades.
    """
    x = np.log10(np.maximum(visibility - 1.0, FAINTEST))
    # Newton's method on the ridge-penalised log-likelihood (iteratively reweighted least squares),
    # steps held to 2.
    design = np.stack([np.ones_like(x), x], axis=1)
    penalty = PRIOR * np.eye(2)
    theta = np.zeros(2)
    for _ in range(steps):
        p = scipy.special.expit(design @ theta)
        gradient = design.T @ (found - p) - penalty @ theta
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
    x = np.array(visibility, float)
    found = np.array(detected, float)
    dut: dict[str, Any] = {
        "n": len(x),
        "visibility": x.tolist(),
        "found": found.astype(bool).tolist(),
        "bins": binned(found > 0, x, VISIBILITIES, np.median),
        **dict.fromkeys(("curve", "half", "half_ci95")),
    }
    if len(x) < ENOUGH:
        return dut
    curve = logistic(x, found)
    rng = np.random.default_rng(seed)
    drawn = []
    for _ in range(DRAWS):
        pick = rng.integers(0, len(x), len(x))
        drawn.append(half_found(logistic(x[pick], found[pick], 25)))
    known = finite(drawn)
    interval = np.quantile(known, [0.025, 0.975]).tolist() if known else None
    return dut | {"curve": list(curve), "half": half_found(curve), "half_ci95": interval}


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
        **{key: {n: metrics(own, seed) for n, own in part.items()} for key, part in parts.items()},
        "sets": [
            {"group": name, "cases": len(own), "seeds": sorted(set(own["seed"]))}
            for name, own in groups.items()
        ],
        "warnings": [lost] if without else [],
        "cases": rows.loc[:, :LAST_SHOWN].to_dict("records"),  # type: ignore[misc]
    }


def metrics(rows: pd.DataFrame, seed: int = 0) -> dict[str, Any]:
    """Return all metrics of cases that are taken together.

    rows: of `outcome`.
    """
    visible = rows[rows["visible"]]
    single, onset = (visible[visible["kind"] == kind] for kind in ("single", "onset"))
    strange, control = (rows[rows["kind"] == kind] for kind in (OUT_OF_LIBRARY, CLEAN))
    known = rows[~rows["kind"].isin((CLEAN, OUT_OF_LIBRARY))]
    begun = rows[rows["kind"].isin(("single", "onset"))].sort_values(
        "kind", ascending=False, kind="stable"
    )
    rates = {
        "single": shares(single, SINGLES),
        "single_felt": shares(single[single["felt"]], SINGLES),
        "single_tellable": shares(single[single["tellable"]], SINGLES),
        "onset": shares(onset, SINGLES),
        "pair": _several(rows, "pair"),
        "triple": _several(rows, "triple"),
        "several": _several(rows, "pair", "triple"),
        "clean": shares(control, {"false_alarm": "alarm", "named": "named"}),
        "foreign": _out_of_library(strange),
    }
    listed = chain.from_iterable(known["errors"][known["visible"]])
    errors = pd.DataFrame(list(listed), columns=list(ERROR))
    replays = finite(known["replay_reduction"][known["visible"]])
    pairs = [(p, true) for own in rows["judged"] for _, p, true in own if p is not None]
    calm = [GUSTS not in true for true in known["true"]]
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
        "parameters": parameter_summary(errors),
        "onset": onset_summary(known),
        "shrink_relative": gap_reduction_summary(known["shrink_relative"]),
        "shrink_relative_calm": gap_reduction_summary(known["shrink_relative"][calm]),
        "shrink_relative_foreign": gap_reduction_summary(strange["shrink_relative"]),
        "replay": {
            "n": len(replays),
            "horizon": HORIZON,
            "median_reduction": median(replays),
            "worse": share(value < 0 for value in replays),
        },
        "detection": detection(begun["visibility"], begun["detected"], seed),
        "reliability": calibration(pairs),
        "effects": _effect_rows(rows, errors),
        "second_look": share(rows["joined"][rows["answered"]]),
        "wall": median(rows["wall"]),
    }


def _several(rows: pd.DataFrame, *kinds: str) -> dict[str, Any]:
    """Return precision, recall and F1 of names, all and visible, and whole cases right; `unknown`:
    added, though the library has all that acts.
    """
    own = rows[rows["kind"].isin(kinds)]
    visible = own[own["visible"]]
    return {
        "all": precision_and_recall(own["counts"]),
        "visible": precision_and_recall(visible["counts"]),
        "class": share(visible["right_class"]),
        "unknown": share(own["unknown"]),
    }


def _out_of_library(rows: pd.DataFrame) -> dict[str, Any]:
    """Return how often out-of-library effects are called unknown, and how often a wrong name is
    given confidently.

    kinds: the same by effect, or by two at once, and as what each is misnamed.
    """
    visible = rows[rows["visible"]]
    return {
        **shares(visible, FOREIGN),
        "unknown_two": share(visible["unknown"][[len(true) > 1 for true in visible["true"]]]),
        "unknown_all": share(rows["unknown"]),
        "wrong_and_sure_all": share(rows["wrong_and_sure"]),
        "kinds": [
            {
                "kind": kind,
                **shares(own, FOREIGN),
                "named": dict(
                    Counter(n for names in own["judged"] for n, *_ in names).most_common()
                ),
            }
            for kind, own in visible.groupby("together")
        ],
    }


def _effect_rows(rows: pd.DataFrame, errors: pd.DataFrame) -> list[dict[str, Any]]:
    """Return, by effect of the library that acts or is named in the set, how it is found, misnamed
    and estimated.
    """
    seen = {*chain.from_iterable(rows["true"]), *chain.from_iterable(rows["verdict"])}
    alone = rows[rows["visible"] & rows["kind"].isin(("single", "onset"))]
    wrong = Counter(name for own in rows["judged"] for name, _, true in own if not true)
    found = []
    for name in (n for n in LIBRARY | MEASURED_ROTORS if n in seen):
        mine = alone[alone["main"] == name]
        estimated = errors[errors["effect"] == name]
        found.append(
            {
                "effect": name,
                "n": len(mine),
                "detected": share(mine["detected"]),
                "exact": share(mine["exact_lenient"]),
                "named_wrongly": wrong[name],
                "median_error": median(estimated["size"][estimated["kind"] == "relative"]),
                "coverage": share(estimated["inside"].explode().dropna()),
            }
        )
    return found
