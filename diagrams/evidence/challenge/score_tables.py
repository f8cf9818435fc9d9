"""A score as tables, and its calibration as a figure."""

from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from operator import getitem
from typing import Any

import numpy as np

from diagrams.batch.run import Table
from np_drake.files.figure_file import DASHES, PALETTE, Figure, new_figure
from np_drake.files.number_text import NOTHING

# Label, and the keys under which a figure stands in a score.
ROWS = (
    ("single ({least}): right class", "rates.single.class"),
    ("  `unknown` beside it allowed", "rates.single.class_unknown_allowed"),
    ("  felt in training too: class", "rates.single_felt.class"),
    ("  that training tells from others: class", "rates.single_tellable.class"),
    ("  right name, nothing else", "rates.single.exact"),
    ("  a wind's drag may lack", "rates.single.exact_lenient"),
    ("onset in flight ({least}): class", "rates.onset.class"),
    ("  flights with onset within 0.2 s", "onset.within"),
    ("  of those whose effect is named", "onset.within_if_named"),
    ("  of those in which it shows ({least} there)", "onset.within_if_seen"),
    ("pairs: precision, recall, F1", "rates.pair.all"),
    ("  {least}", "rates.pair.visible"),
    ("triples: precision, recall, F1", "rates.triple.all"),
    ("  {least}", "rates.triple.visible"),
    ("pairs and triples: F1", "rates.several.all"),
    ("  `unknown` added", "rates.several.unknown"),
    ("clean controls: false alarm", "rates.clean.false_alarm"),
    ("foreign ({least}): `unknown`", "rates.foreign.unknown"),
    ("  two at once", "rates.foreign.unknown_two"),
    ("  all", "rates.foreign.unknown_all"),
    ("  a wrong name above 0.9", "rates.foreign.wrong_and_sure"),
    ("  of all", "rates.foreign.wrong_and_sure_all"),
    ("  `unknown` and no name", "rates.foreign.alone"),
    ("parameters: median relative error [1]", "parameters.median_error"),
    ("  inside the 95 % interval", "parameters.coverage_rate"),
    ("  hook, median error [m]", "parameters.place_error"),
    ("  rotor, right number", "parameters.choice"),
    ("held-out shrink: mean, median", "shrink_relative"),
    ("  cases without gusts", "shrink_relative_calm"),
    ("  foreign effects", "shrink_relative_foreign"),
    ("half are found at visibility", "detection"),
    ("Brier score, calibration error", "reliability"),
    ("replay, 1 s: median reduction [1]", "replay.median_reduction"),
    ("  it grows", "replay.worse"),
    ("second look taken", "second_look"),
    ("median time a case [s]", "wall"),
)
MARKERS = ("o", "s", "^", "D")
PARTS = ("precision", "recall", "f1", "mean", "median", "half", "brier", "ece")  # that are shown


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
    known = ", ".join(str(written(value[key])) for key in PARTS if key in value)
    return f"{known} ({n})" if n else NOTHING


def table(title: str, lines: Iterable[Mapping[str, Any]]) -> list[Table]:
    """Return lines of figures by header as a table, in a list; none where there are no lines."""
    rows = list(lines)
    header = list(dict.fromkeys(key for row in rows for key in row))
    cells = [tuple(written(row.get(key)) for key in header) for row in rows]
    return [(title, header, cells)] if rows else []


def tables(score: dict[str, Any], least: float) -> list[Table]:
    """Return the tables worth printing: metrics by quality where a set mixes simulators, metrics by
    set, what is found by visibility, effects.

    least: visibility from which its cases count as visible [1].
    """
    whole = "all" if score["groups"] else score["sets"][0]["group"]
    sure = f"≥ {least:g}"
    parts = [some for some in (score["qualities"], {whole: score, **score["groups"]}) if some]
    found: dict[float, dict[str, Any]] = {}
    for name, part in parts[0].items():
        for row in part["detection"]["bins"]:
            edges = f"{row['lower']:g} … {row['upper']:g}"
            found.setdefault(row["lower"], {"visibility": edges})[name] = row
    metrics = (
        [
            {"figure": label.format(least=sure), **{n: at(own, keys) for n, own in some.items()}}
            for label, keys in ROWS
        ]
        for some in parts
    )
    title = f"score: [95 % interval], cases; ({sure}): of that visibility; shrink: true model = 1"
    return [
        *(made for lines in metrics for made in table(title, lines)),
        *table(
            "single effects found, from the start or begun in flight",
            (found[edge] for edge in sorted(found)),
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
    """Return every miss that counts: what acts, how visible, what was said with which
    probability.
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


def set_lines(score: dict[str, Any]) -> list[str]:
    """Return where the cases come from, a line a group."""
    return [
        f"{part['group']}: {part['cases']} cases, seed {', '.join(map(str, part['seeds']))}"
        for part in score["sets"]
    ]


def calibration_figure(series: Mapping[str, Sequence[Mapping[str, Any]]]) -> Figure:
    """Draw reported probability against share true, by series of bins, with 95 % intervals."""
    figure, axes = new_figure(1, 1, width=5.2, height=4.4)
    ax = axes[0, 0]
    ax.plot([0, 1], [0, 1], color="0.6", linewidth=1, label="as reported")
    for i, (name, rows) in enumerate((name, rows) for name, rows in series.items() if rows):
        x, y = ([row[key] for row in rows] for key in ("mean", "rate"))
        bounds = np.abs(np.array([row["ci95"] for row in rows]).T - y)
        label = f"{name} (n = {sum(row['n'] for row in rows)})"
        style = {"color": PALETTE[i], "marker": MARKERS[i], "linestyle": DASHES[i]}
        ax.errorbar(x, y, bounds, markersize=5, capsize=3, linewidth=1, label=label, **style)
    ax.set(xlim=(-0.02, 1.03), ylim=(-0.04, 1.04), ylabel="share that is true, 95 % interval [1]")
    ax.set(xlabel="reported probability of a name [1]")
    figure.legend(loc="outside lower center", ncols=2)
    return figure
