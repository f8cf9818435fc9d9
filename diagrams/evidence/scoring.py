"""Scores of answers, to simulated and to real flights: rows of what an answer says beside what is
known, figures of the rows by a table of named aggregates, and their tables and pictures.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import reduce
from itertools import chain
from operator import getitem
from typing import Any

import numpy as np
import pandas as pd
import scipy

from diagrams.batch.run import Table
from np_drake.files.figure_file import DASHES, PALETTE, Figure, new_figure
from np_drake.files.number_text import NOTHING

SURE = 0.9  # probability of a cause above which a wrong name counts as a claim
PROBABILITIES = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0)  # edges of bins [1]
MARKERS = ("o", "s", "^", "D")
PARTS = ("precision", "recall", "f1", "mean", "median", "half", "brier", "ece")  # that are shown


# Aggregates: of the values of a column


def share(outcomes: Iterable[Any]) -> dict[str, Any]:
    """Return {"count", "n", "rate", "ci95"} of outcomes, or of lists of them; None is no outcome,
    and the rate of none is None.

    ci95: the exact binomial interval of Clopper and Pearson.
    """
    values = pd.Series(outcomes, dtype=object).explode().dropna().astype(bool)
    n = len(values)
    if not n:
        return {"count": 0, "n": 0, "rate": None, "ci95": [0.0, 1.0]}
    count = int(values.sum())
    interval = scipy.stats.binomtest(count, n).proportion_ci()
    return {"count": count, "n": n, "rate": count / n, "ci95": [interval.low, interval.high]}


def summary(values: Iterable[float | None]) -> dict[str, Any]:
    """Return {"n", "mean", "median"} of the finite values; None where there are none."""
    series = pd.Series(values, dtype=float)
    finite = series[np.isfinite(series)]
    figures = finite.agg(["mean", "median"]).to_dict() if len(finite) else {}
    return {"n": len(finite), "mean": None, "median": None, **figures}


def median(values: Iterable[float | None]) -> float | None:
    """Return the median of the finite values; None where there are none."""
    return summary(values)["median"]


def precision_and_recall(counts: Iterable[tuple[int, int, int]]) -> dict[str, Any]:
    """Return precision, recall and F1, pooled over cases of (right, too many, missing); None where
    undefined.
    """
    table = np.reshape(list(counts), (-1, 3))
    right, extra, missing = table.sum(axis=0).tolist()
    of = {
        "precision": right + extra,
        "recall": right + missing,
        "f1": right + (extra + missing) / 2,
    }
    ratios = {name: right / total if total else None for name, total in of.items()}
    return {"cases": len(table), "right": right, "extra": extra, "missing": missing, **ratios}


def binned(
    values: pd.Series, outcomes: pd.Series, edges: Sequence[float], statistic: str, *, closed: str
) -> list[dict[str, Any]]:
    """Return the share of outcomes by bin of values, with edges and `statistic` (`mean` | `median`)
    of the values; empty bins are left out.

    closed: edge that belongs to a bin, `left` | `right`.
    """
    bins = pd.cut(
        values, edges, labels=False, right=closed == "right", include_lowest=closed == "right"
    )
    return [
        {
            "lower": edges[int(k)],
            "upper": edges[int(k) + 1],
            statistic: part.agg(statistic),
            **share(outcomes[part.index]),
        }
        for k, part in values.groupby(bins)
    ]


def calibration(
    judged: Iterable[Sequence[tuple[str, float | None, bool | None]]],
    edges: Sequence[float] = PROBABILITIES,
    closed: str = "right",
) -> dict[str, Any]:
    """Return reported probabilities against whether the names are right, by bin.

    brier: mean square of probability minus outcome.
    ece: mean of |share right - mean probability| over bins, weighted by count.

    judged: by case, (name, probability, whether it is right); None where one is not known.
    """
    names = [name for case in judged for name in case]
    known = pd.DataFrame(names, columns=["name", "p", "right"]).dropna()
    if not len(known):
        return {"n": 0, "bins": [], "brier": None, "ece": None}
    known = known.reset_index().astype({"p": float, "right": bool})
    rows = binned(known["p"], known["right"], edges, "mean", closed=closed)
    return {
        "n": len(known),
        "bins": rows,
        "brier": ((known["p"] - known["right"]) ** 2).mean(),
        "ece": sum(row["n"] * abs(row["rate"] - row["mean"]) for row in rows) / len(known),
    }


AGGREGATES: dict[str, Callable[..., Any]] = {
    "n": len,
    "share": share,
    "sum": lambda values: int(values.sum()),
    "mean": pd.Series.mean,
    "median": median,
    "most": max,
    "first": lambda values: values.iloc[0],
    "named": lambda judged: dict(Counter(name for name, *_ in chain(*judged)).most_common()),
    "summary": summary,
    "names": precision_and_recall,
    "calibration": calibration,
}


def listed(rows: pd.DataFrame, column: str, fields: list[str]) -> pd.DataFrame:
    """Return a row for every record in a column of lists: its fields, and the others of its
    case.
    """
    records = rows.explode(column).dropna(subset=column).reset_index(drop=True)
    content = pd.DataFrame(records[column].tolist(), columns=fields)
    return records.drop(columns=fields, errors="ignore").join(content)


def aggregate(rows: pd.DataFrame, line: Mapping[str, Any]) -> Any:
    """Return the figure of a line {"column", "gather": name of an aggregate, "options": of that,
    "part": of the figure}.

    `column` may name several figures, each by its column or by a line. With `by`, columns by name,
    it is a list of figures, a line for each of their values.
    """
    if "by" in line:
        names = list(line["by"])
        parts = rows.groupby(list(line["by"].values()), observed=True)
        rest = {key: value for key, value in line.items() if key != "by"}
        return [
            dict(zip(names, values, strict=True)) | aggregate(part, rest) for values, part in parts
        ]
    column = line["column"]
    if isinstance(column, Mapping):
        lines = {k: of if isinstance(of, Mapping) else {"column": of} for k, of in column.items()}
        return {key: aggregate(rows, {**line, **of}) for key, of in lines.items()}
    figure = AGGREGATES[line["gather"]](rows[column], **line.get("options", {}))
    return figure[line["part"]] if "part" in line else figure


# Tables and pictures of figures


def at(score: dict[str, Any], keys: str) -> Any:
    """Return a value of a score, under keys with dots between."""
    return reduce(getitem, keys.split("."), score)


def written(value: Any) -> Any:
    """Return a figure as text, by what it is; a dash where there are no cases."""
    if not isinstance(value, dict):
        text = f"{value:.3g}" if isinstance(value, float) else value
        return NOTHING if value is None or value != value else text
    n = value.get("n", value.get("cases"))
    if n and "rate" in value:
        low, high = (round(100 * bound, 9) for bound in value["ci95"])
        return f"{100 * value['rate']:.0f} % [{low:.0f}, {high:.0f}] {value['count']}/{n}"
    parts = ", ".join(str(written(value[key])) for key in PARTS if key in value)
    return f"{parts} ({n})" if n else NOTHING


def table(title: str, lines: Iterable[Mapping[str, Any]] | pd.DataFrame) -> list[Table]:
    """Return lines of figures by header as a table, in a list; none where there are no lines."""
    rows = lines.to_dict("records") if isinstance(lines, pd.DataFrame) else list(lines)
    header = list(dict.fromkeys(str(key) for row in rows for key in row))
    cells = [tuple(written(row.get(key)) for key in header) for row in rows]
    return [(title, header, cells)] if rows else []


def calibration_figure(series: Mapping[str, Sequence[Mapping[str, Any]]]) -> Figure:
    """Draw reported probability against share true, by series of bins, with 95 % intervals."""
    figure, axes = new_figure(1, 1, width=5.2, height=4.4)
    ax = axes[0, 0]
    ax.plot([0, 1], [0, 1], color="0.6", linewidth=1, label="as reported")
    for i, (name, rows) in enumerate((name, rows) for name, rows in series.items() if rows):
        x, y = ([row[key] for row in rows] for key in ("mean", "rate"))
        bounds = np.abs(np.array([row["ci95"] for row in rows]).T - y)
        label = f"{name} (n = {sum(row['n'] for row in rows)})"
        ax.errorbar(
            x,
            y,
            bounds,
            label=label,
            color=PALETTE[i],
            marker=MARKERS[i],
            linestyle=DASHES[i],
            markersize=5,
            capsize=3,
            linewidth=1,
        )
    ax.set(xlim=(-0.02, 1.03), ylim=(-0.04, 1.04), ylabel="share that is true, 95 % interval [1]")
    ax.set(xlabel="reported probability of a name [1]")
    figure.legend(loc="outside lower center", ncols=2)
    return figure
