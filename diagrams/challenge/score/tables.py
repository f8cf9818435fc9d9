"""A score as tables: (title, header, rows) each."""

from collections.abc import Sequence
from typing import Any

Table = tuple[str, list[str], list[list[Any]]]
NOTHING = "–"


def tables(score: dict[str, Any], least: float) -> list[Table]:
    """Return the tables worth printing: metrics by quality where a set mixes simulators, metrics by set, effects."""
    parts = {**({"all": score} if score["groups"] else {name_of_set(score): score}), **score["groups"]}
    title = f"score: [95 % interval], cases; (≥ {least:g}): of that visibility; shrink: true model = 1"
    columns = [some for some in (score["qualities"], parts) if some]
    return [
        *((title, ["figure", *some], metric_rows(some, least)) for some in columns),
        *(detection_table(some) for some in columns[:1]),
        (
            f"effects, cases of one with visibility ≥ {least:g}",
            ["effect", "n", "found", "right name", "named wrongly", "median error", "coverage"],
            [effect_cells(row) for row in score["effects"]],
        ),
        *out_of_library_table(score, least),
    ]


def metric_rows(parts: dict[str, dict[str, Any]], least: float) -> list[list[Any]]:
    """Return a row a metric, a column a part of the cases."""
    return [[label, *(cell(part) for part in parts.values())] for label, cell in lines(least)]


def lines(least: float) -> list[tuple[str, Any]]:
    """Return (label, cell of a score) for every metric."""
    return [
        (f"single (≥ {least:g}): right class", lambda s: share(s["rates"]["single"]["class"])),
        ("  `unknown` beside it allowed", lambda s: share(s["rates"]["single"]["class_unknown_allowed"])),
        ("  felt in training too: class", lambda s: share(s["rates"]["single_felt"]["class"])),
        ("  that training tells from others: class", lambda s: share(s["rates"]["single_tellable"]["class"])),
        ("  right name, nothing else", lambda s: share(s["rates"]["single"]["exact"])),
        ("  a wind's drag may lack", lambda s: share(s["rates"]["single"]["exact_lenient"])),
        (f"onset in flight (≥ {least:g}): class", lambda s: share(s["rates"]["onset"]["class"])),
        ("  flights with onset within 0.2 s", lambda s: share(s["onset"]["within"])),
        ("  of those whose effect is named", lambda s: share(s["onset"]["within_if_named"])),
        (f"  of those in which it shows (≥ {least:g} there)", lambda s: share(s["onset"]["within_if_seen"])),
        ("  of those that the true effect tells", lambda s: share(s["onset"]["within_if_told"])),
        ("pairs: precision, recall, F1", lambda s: three(s["rates"]["pair"]["all"])),
        (f"  ≥ {least:g}", lambda s: three(s["rates"]["pair"]["visible"])),
        ("triples: precision, recall, F1", lambda s: three(s["rates"]["triple"]["all"])),
        (f"  ≥ {least:g}", lambda s: three(s["rates"]["triple"]["visible"])),
        ("pairs and triples: F1", lambda s: three(s["rates"]["several"]["all"])),
        ("  `unknown` added", lambda s: share(s["rates"]["several"]["unknown"])),
        ("clean controls: false alarm", lambda s: share(s["rates"]["clean"]["false_alarm"])),
        (f"foreign (≥ {least:g}): `unknown`", lambda s: share(s["rates"]["foreign"]["unknown"])),
        ("  two at once", lambda s: share(s["rates"]["foreign"]["unknown_two"])),
        ("  all", lambda s: share(s["rates"]["foreign"]["unknown_all"])),
        ("  a wrong name above 0.9", lambda s: share(s["rates"]["foreign"]["wrong_and_sure"])),
        ("  of all", lambda s: share(s["rates"]["foreign"]["wrong_and_sure_all"])),
        ("  `unknown` and no name", lambda s: share(s["rates"]["foreign"]["alone"])),
        ("parameters: median relative error", lambda s: percent(s["parameters"]["median_error"])),
        ("  inside the 95 % interval", lambda s: share(s["parameters"]["coverage_rate"])),
        ("  hook, median error [m]", lambda s: number(s["parameters"]["place_error"])),
        ("  rotor, right number", lambda s: share(s["parameters"]["choice"])),
        ("held-out shrink: mean, median", lambda s: shrink(s["shrink_relative"])),
        ("  true parameters, not every gust", lambda s: shrink(s["shrink_relative_parameters"])),
        ("  cases without gusts", lambda s: shrink(s["shrink_relative_calm"])),
        ("  foreign effects", lambda s: shrink(s["shrink_relative_foreign"])),
        ("half are found at visibility", lambda s: half(s["detection"])),
        ("Brier score, calibration error", lambda s: reliability(s["reliability"])),
        ("replay, 1 s: median reduction", lambda s: percent(s["replay"]["median_reduction"])),
        ("  it grows", lambda s: share(s["replay"]["worse"])),
        ("second look taken", lambda s: share(s["second_look"])),
        ("median time a case [s]", lambda s: number(s["wall"])),
    ]


def detection_table(parts: dict[str, dict[str, Any]]) -> Table:
    """Return single effects found, by visibility: a row a bin, a column a part of the cases."""
    bins = [{(row["lower"], row["upper"]): row for row in s["detection"]["bins"]} for s in parts.values()]
    edges = sorted({edge for some in bins for edge in some})
    rows = [[f"{a:g} … {b:g}", *(_found(some.get((a, b))) for some in bins)] for a, b in edges]
    return "single effects found, from the start or begun in flight", ["visibility", *parts], rows


def _found(row: dict[str, Any] | None) -> str:
    return f"{row['count']} of {row['n']}" if row else NOTHING


def out_of_library_table(score: dict[str, Any], least: float) -> list[Table]:
    """Return a row an out-of-library effect, where there are any."""
    rows = [
        [
            row["kind"],
            *(f"{row[how]['count']} of {row[how]['n']}" for how in ("unknown", "alone", "wrong_and_sure")),
            named(row),
        ]
        for row in score["rates"]["foreign"]["kinds"]
    ]
    title = f"foreign effects with visibility ≥ {least:g}"
    return [(title, ["kind", "`unknown`", "and no name", "wrong above 0.9", "names"], rows)] if rows else []


def named(row: dict[str, Any]) -> str:
    """Return names and how often they were said."""
    return ", ".join(f"{name} {count}" for name, count in row["named"].items()) or NOTHING


def effect_cells(row: dict[str, Any]) -> list[Any]:
    """Return a line of the table of effects."""
    found, right = row["detected"], row["exact"]
    return [
        row["effect"],
        row["n"],
        f"{found['count']} of {found['n']}" if row["n"] else NOTHING,
        f"{right['count']} of {right['n']}" if row["n"] else NOTHING,
        row["named_wrongly"],
        percent(row["median_error"]),
        f"{row['coverage']['count']} of {row['coverage']['n']}" if row["coverage"]["n"] else NOTHING,
    ]


def miss_table(score: dict[str, Any]) -> Table:
    """Return every miss that counts: what acts, how visible, what was said with which probability."""
    rows = [miss_cells(row) for row in score["cases"] if row["missed"]]
    return "misses", ["case", "kind", "visibility", "truth", "verdict", "shrink"], rows


def miss_cells(row: dict[str, Any]) -> list[Any]:
    """Return a line of the table of misses."""
    said = [f"{name} {number(row['probability'].get(name))}".removesuffix(NOTHING) for name in row["verdict"]]
    verdict = ", ".join(text.strip() for text in said) if row["answered"] else "no answer"
    return [
        row["case"],
        row["kind"],
        row["visibility"],
        ", ".join(row["true"]) or "nothing",
        verdict or "nothing",
        number(row["shrink_relative"]),
    ]


def name_of_set(score: dict[str, Any]) -> str:
    """Return simulator and quality of a set that does not mix them."""
    return str(score["sets"][0]["group"]) if score["sets"] else "none"


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


def three(names: dict[str, Any]) -> str:
    """Return precision, recall, F1 and how many cases."""
    if not names["cases"]:
        return NOTHING
    values = ", ".join(number(names[key], 2) for key in ("precision", "recall", "f1"))
    return f"{values} ({names['cases']})"


def shrink(values: dict[str, Any]) -> str:
    """Return mean, median and how many cases."""
    if not values["n"]:
        return NOTHING
    return f"{values['mean']:.3f}, {values['median']:.3f} ({values['n']})"


def half(detection: dict[str, Any]) -> str:
    """Return the visibility at which half are found, with its interval."""
    bounds: Sequence[float] | None = detection["half_ci95"]
    if detection["half"] is None or bounds is None:
        return NOTHING
    return f"{detection['half']:.3g} [{bounds[0]:.3g}, {bounds[1]:.3g}]"


def reliability(values: dict[str, Any]) -> str:
    """Return Brier score and expected calibration error."""
    return NOTHING if not values["n"] else f"{values['brier']:.3f}, {values['ece']:.3f} ({values['n']})"


def percent(value: float | None) -> str:
    """Return a percentage of three digits."""
    return NOTHING if value is None else f"{100 * value:.3g} %"


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with significant digits."""
    return NOTHING if value is None else f"{value:.{digits}g}"
