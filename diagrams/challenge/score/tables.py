"""A score as tables."""

from collections.abc import Callable
from typing import Any

from diagrams.batch.run import Table

NOTHING, NO_CASES = "–", {"n": 0}


def tables(score: dict[str, Any], least: float) -> list[Table]:
    """Return the tables worth printing: metrics by quality where a set mixes simulators, metrics by
    set, effects.

    Args:
        score: as `score` returns it.
        least: visibility from which its cases count as visible [1].
    """
    whole = "all" if score["groups"] else str(score["sets"][0]["group"])
    parts = {whole: score, **score["groups"]}
    title = (
        f"score: [95 % interval], cases; (≥ {least:g}): of that visibility; shrink: true model = 1"
    )
    columns = [some for some in (score["qualities"], parts) if some]
    return [
        *((title, ["figure", *some], _metric_rows(some, least)) for some in columns),
        _detection_table(columns[0]),
        (
            f"effects, cases of one with visibility ≥ {least:g}",
            ["effect", "n", "found", "right name", "named wrongly", "median error", "coverage"],
            [
                (
                    row["effect"],
                    row["n"],
                    _count(row["detected"]),
                    _count(row["exact"]),
                    row["named_wrongly"],
                    _percent(row["median_error"]),
                    _count(row["coverage"]),
                )
                for row in score["effects"]
            ],
        ),
        *_out_of_library_table(score, least),
    ]


def _metric_rows(parts: dict[str, dict[str, Any]], least: float) -> list[tuple]:
    return [
        (label.format(least=f"≥ {least:g}"), *(how(at(part, keys)) for part in parts.values()))
        for label, how, keys in ROWS
    ]


def at(score: dict[str, Any], keys: str) -> Any:
    """Return a value of a score.

    Args:
        score: as `score` returns it.
    """
    value: Any = score
    for key in keys.split("."):
        value = value[key]
    return value


def _detection_table(parts: dict[str, dict[str, Any]]) -> Table:
    """Return single effects found, by visibility: a row a bin, a column a part of the cases."""
    bins = [
        {(row["lower"], row["upper"]): row for row in s["detection"]["bins"]}
        for s in parts.values()
    ]
    edges = sorted({edge for some in bins for edge in some})
    rows = [
        (f"{a:g} … {b:g}", *(_count(some.get((a, b), NO_CASES)) for some in bins)) for a, b in edges
    ]
    return "single effects found, from the start or begun in flight", ["visibility", *parts], rows


def _out_of_library_table(score: dict[str, Any], least: float) -> list[Table]:
    """Return a row an out-of-library effect, where there are any."""
    rows = [
        (
            row["kind"],
            *(_count(row[how]) for how in ("unknown", "alone", "wrong_and_sure")),
            ", ".join(f"{name} {count}" for name, count in row["named"].items()) or NOTHING,
        )
        for row in score["rates"]["foreign"]["kinds"]
    ]
    title = f"foreign effects with visibility ≥ {least:g}"
    return (
        [(title, ["kind", "`unknown`", "and no name", "wrong above 0.9", "names"], rows)]
        if rows
        else []
    )


def miss_table(score: dict[str, Any]) -> Table:
    """Return every miss that counts: what acts, how visible, what was said with which
    probability.
    """
    rows = []
    for row in (row for row in score["cases"] if row["missed"]):
        said = [(name, row["probability"].get(name)) for name in row["verdict"]]
        verdict = (
            ", ".join(name if p is None else f"{name} {p:.3g}" for name, p in said) or "nothing"
        )
        rows.append(
            (
                row["case"],
                row["kind"],
                row["visibility"],
                ", ".join(row["true"]) or "nothing",
                verdict if row["answered"] else "no answer",
                row["shrink_relative"],
            )
        )
    return "misses", ["case", "kind", "visibility", "truth", "verdict", "shrink"], rows


def set_lines(score: dict[str, Any]) -> list[str]:
    """Return where the cases come from, a line a group."""
    return [
        f"{part['group']}: {part['cases']} cases, seed {', '.join(map(str, part['seeds']))}"
        for part in score["sets"]
    ]


def share(rate: dict[str, Any]) -> str:
    """Return a share as `93 % [81, 99] 41/44`."""
    if not rate["n"]:
        return NOTHING
    low, high = (100 * bound for bound in rate["ci95"])
    return f"{100 * rate['rate']:.0f} % [{low:.0f}, {high:.0f}] {rate['count']}/{rate['n']}"


def _count(rate: dict[str, Any]) -> str:
    return f"{rate['count']} of {rate['n']}" if rate["n"] else NOTHING


def _names(counts: dict[str, Any]) -> str:
    """Return precision, recall, F1 and how many cases."""
    known = [counts[key] for key in ("precision", "recall", "f1")]
    values = ", ".join(NOTHING if value is None else f"{value:.2g}" for value in known)
    return f"{values} ({counts['cases']})" if counts["cases"] else NOTHING


def _shrink(values: dict[str, Any]) -> str:
    return (
        f"{values['mean']:.3f}, {values['median']:.3f} ({values['n']})" if values["n"] else NOTHING
    )


def _half(detection: dict[str, Any]) -> str:
    """Return the visibility at which half are found, with its interval."""
    half, bounds = detection["half"], detection["half_ci95"]
    return (
        NOTHING
        if half is None or bounds is None
        else f"{half:.3g} [{bounds[0]:.3g}, {bounds[1]:.3g}]"
    )


def _reliability(values: dict[str, Any]) -> str:
    """Return Brier score and expected calibration error."""
    return f"{values['brier']:.3f}, {values['ece']:.3f} ({values['n']})" if values["n"] else NOTHING


def _percent(value: float | None) -> str:
    return NOTHING if value is None else f"{100 * value:.3g} %"


def _plain(value: float | None) -> float | None:
    return value


# Label, how the value is written, and the keys under which it stands in a score.
ROWS: tuple[tuple[str, Callable[[Any], Any], str], ...] = (
    ("single ({least}): right class", share, "rates.single.class"),
    ("  `unknown` beside it allowed", share, "rates.single.class_unknown_allowed"),
    ("  felt in training too: class", share, "rates.single_felt.class"),
    ("  that training tells from others: class", share, "rates.single_tellable.class"),
    ("  right name, nothing else", share, "rates.single.exact"),
    ("  a wind's drag may lack", share, "rates.single.exact_lenient"),
    ("onset in flight ({least}): class", share, "rates.onset.class"),
    ("  flights with onset within 0.2 s", share, "onset.within"),
    ("  of those whose effect is named", share, "onset.within_if_named"),
    ("  of those in which it shows ({least} there)", share, "onset.within_if_seen"),
    ("  of those that the true effect tells", share, "onset.within_if_told"),
    ("pairs: precision, recall, F1", _names, "rates.pair.all"),
    ("  {least}", _names, "rates.pair.visible"),
    ("triples: precision, recall, F1", _names, "rates.triple.all"),
    ("  {least}", _names, "rates.triple.visible"),
    ("pairs and triples: F1", _names, "rates.several.all"),
    ("  `unknown` added", share, "rates.several.unknown"),
    ("clean controls: false alarm", share, "rates.clean.false_alarm"),
    ("foreign ({least}): `unknown`", share, "rates.foreign.unknown"),
    ("  two at once", share, "rates.foreign.unknown_two"),
    ("  all", share, "rates.foreign.unknown_all"),
    ("  a wrong name above 0.9", share, "rates.foreign.wrong_and_sure"),
    ("  of all", share, "rates.foreign.wrong_and_sure_all"),
    ("  `unknown` and no name", share, "rates.foreign.alone"),
    ("parameters: median relative error", _percent, "parameters.median_error"),
    ("  inside the 95 % interval", share, "parameters.coverage_rate"),
    ("  hook, median error [m]", _plain, "parameters.place_error"),
    ("  rotor, right number", share, "parameters.choice"),
    ("held-out shrink: mean, median", _shrink, "shrink_relative"),
    ("  true parameters, not every gust", _shrink, "shrink_relative_parameters"),
    ("  cases without gusts", _shrink, "shrink_relative_calm"),
    ("  foreign effects", _shrink, "shrink_relative_foreign"),
    ("half are found at visibility", _half, "detection"),
    ("Brier score, calibration error", _reliability, "reliability"),
    ("replay, 1 s: median reduction", _percent, "replay.median_reduction"),
    ("  it grows", share, "replay.worse"),
    ("second look taken", share, "second_look"),
    ("median time a case [s]", _plain, "wall"),
)
