"""Scores of several draws side by side, against what is asked for."""

import dataclasses as dc
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from diagrams.challenge.score.schema import SchemaValidator, list_of, object_of, or_null, record, violation
from diagrams.challenge.score.tables import NOTHING, Table
from np_drake.files.input_file import read_json

QUALITIES = ("clean", "real", "wild")
SCORE, DRAWS = "np_drake.challenge_score/1", "np_drake.challenge_compare/1"
Value = dict[
    str, Any
]  # {"count", "n"} of a share, {"value"} of what is no share; None where there are no cases


@dc.dataclass(frozen=True)
class Metric:
    """A metric of a score: its reader (`share` or `plain`), and the least and most that are asked for by quality."""

    label: str
    of: Callable[[dict[str, Any]], Value]
    clean: tuple[float, float] | None = None
    real: tuple[float, float] | None = None
    wild: tuple[float, float] | None = None

    def falls_short(self, quality: str, value: Value) -> bool:
        """Return whether a value is outside what is asked for."""
        asked, known = self.asked(quality), number(value)
        return asked is not None and known is not None and not asked[0] <= known <= asked[1]

    def asked(self, quality: str) -> tuple[float, float] | None:
        """Return the least and most that are asked for [1]; None: nothing is."""
        return {"clean": self.clean, "real": self.real, "wild": self.wild}[quality]


def least(bound: float) -> tuple[float, float]:
    """Return the bounds of a metric that must be at least this."""
    return bound, float("inf")


def most(bound: float) -> tuple[float, float]:
    """Return the bounds of a metric that must be at most this."""
    return -float("inf"), bound


def share(*keys: str) -> Callable[[dict[str, Any]], Value]:
    """Return a reader of a count and its total at these keys of a score."""
    return lambda score: {key: _at(score, keys)[key] for key in ("count", "n")}


def plain(*keys: str) -> Callable[[dict[str, Any]], Value]:
    """Return a reader of a number at these keys of a score."""
    return lambda score: {"value": _at(score, keys)}


METRICS = (
    Metric("single: right class", share("rates", "single", "class"), least(0.98), least(0.88), least(0.85)),
    Metric("right name, nothing else", share("rates", "single", "exact"), least(0.93), least(0.80)),
    Metric("pairs and triples: F1", plain("rates", "several", "all", "f1"), least(0.92), least(0.75)),
    Metric("`unknown` added to them", share("rates", "several", "unknown"), most(0.1), most(0.1), most(0.1)),
    Metric(
        "clean controls: false alarm",
        share("rates", "clean", "false_alarm"),
        most(0.01),
        most(0.03),
        most(0.02),
    ),
    Metric("foreign: `unknown`", share("rates", "foreign", "unknown"), least(0.92), least(0.75), least(0.85)),
    Metric("a wrong name above 0.9", share("rates", "foreign", "wrong_and_sure"), most(0.0), most(0.02)),
    Metric("parameters: median error", plain("parameters", "median_error"), most(0.03), most(0.08)),
    Metric(
        "in the 95 % interval", share("parameters", "coverage_rate"), (0.90, 0.99), (0.88, 0.99), (0.90, 0.98)
    ),
    Metric("onset within 0.2 s", share("onset", "within"), least(0.90), least(0.75)),
    Metric("where it shows", share("onset", "within_if_seen")),
    Metric("where the true effect tells", share("onset", "within_if_told")),
    Metric("shrink, mean", plain("shrink_relative", "mean"), least(0.95), least(0.85)),
    Metric("true parameters, not every gust", plain("shrink_relative_parameters", "mean")),
    Metric("half are found at visibility", plain("detection", "half"), most(1.1), most(1.3)),
    Metric("calibration error", plain("reliability", "ece"), wild=most(0.05)),
    Metric("replay, 1 s: reduction", plain("replay", "median_reduction"), least(0.70), least(0.70)),
)

NUMBER = {"description": "a finite number", "type": "number"}
WHOLE = {"description": "a whole number from 0", "type": "integer", "minimum": 0}
VALUE = record({}, spare={"count": WHOLE, "n": WHOLE, "value": or_null(NUMBER)})
DRAW = record({"seeds": list_of(WHOLE)}, spare=dict.fromkeys(QUALITIES, object_of(VALUE)))
KEPT, ONE = SchemaValidator(record({"draws": list_of(DRAW)})), SchemaValidator(DRAW)


def read_draws(files: Iterable[Path]) -> list[dict[str, Any]]:
    """Return {"seeds", quality: {label: value}} of every draw, in order of seeds; of one that is there twice, the last.

    Args: files: each what `challenge score --json` wrote, or `challenge compare --json`.
    Raises: ValueError: where a file is neither; OSError: where it cannot be read.
    """
    found = {tuple(draw["seeds"]): draw for file in files for draw in _read(file)}
    return [found[seeds] for seeds in sorted(found)]


def _read(file: Path) -> list[dict[str, Any]]:
    try:
        content = read_json(file)
        schema = content["schema"]
    except (ValueError, TypeError, KeyError, RecursionError):
        schema = None
    if schema == DRAWS:
        fault = violation(KEPT, content)
        if fault is not None:
            raise ValueError(f"{file}: {fault}")
        return list(content["draws"])
    if schema != SCORE:
        raise ValueError(
            f"{file}: must be what `challenge score --json` or `challenge compare --json` wrote."
        )
    try:
        draw = draw_of(content)
    except (KeyError, TypeError, IndexError, AttributeError) as error:
        raise ValueError(f"{file}: must be a whole score; {error} cannot be read.") from error
    fault = violation(ONE, draw)
    if fault is not None:
        raise ValueError(f"{file}: must be a whole score; {fault}")
    return [draw]


def draw_of(score: dict[str, Any]) -> dict[str, Any]:
    """Return the metrics of a score by quality, and the seeds of its sets."""
    seeds = sorted({seed for part in score["sets"] for seed in part["seeds"]})
    metrics = {name: {f.label: f.of(part) for f in METRICS} for name, part in _by_quality(score).items()}
    return {"seeds": seeds, **metrics}


def _by_quality(score: dict[str, Any]) -> dict[str, Any]:
    """Return the parts of a score by quality; the whole score where a set has one quality."""
    groups = score["groups"] or {score["sets"][0]["group"]: score}
    parts = score["qualities"] or {group.rsplit(", ", 1)[1]: part for group, part in groups.items()}
    return {name: parts[name] for name in QUALITIES if name in parts}


def table(draws: Sequence[dict[str, Any]], quality: str) -> tuple[list[str], list[list[str]]]:
    """Return header and rows: a row a metric, a column a draw, then all draws together; bold where it falls short."""
    having = [draw for draw in draws if quality in draw]
    header = [quality, "asked", *map(name_of, having), "together"]
    rows = []
    for metric in METRICS:
        values = [draw[quality].get(metric.label, {}) for draw in having]
        cells = [_cell(metric, quality, value) for value in [*values, together(values)]]
        rows.append([metric.label, _asked(metric.asked(quality)), *cells])
    return header, rows


def asked_table(score: dict[str, Any], quality: str) -> list[Table]:
    """Return what is asked for of this quality beside what a score has, where it has cases of it."""
    part = _by_quality(score).get(quality)
    if part is None:
        return []
    rows = [
        [metric.label, _asked(metric.asked(quality)), _cell(metric, quality, metric.of(part))]
        for metric in METRICS
        if metric.asked(quality) is not None
    ]
    return [(f"asked of `{quality}`; short ones between asterisks", ["figure", "asked", quality], rows)]


def name_of(draw: dict[str, Any]) -> str:
    """Return a draw's name: `48xxx` where all seeds begin so."""
    thousands = {seed // 1000 for seed in draw["seeds"]}
    return f"{thousands.pop()}xxx" if len(thousands) == 1 else ", ".join(map(str, draw["seeds"]))


def together(values: Sequence[Value]) -> Value:
    """Return the share of all; nothing of what is no share."""
    shares = [value for value in values if "count" in value and "n" in value]
    return {key: sum(value[key] for value in shares) for key in ("count", "n")} if shares else {}


def number(value: Value) -> float | None:
    """Return the share, or the number."""
    if "count" in value and "n" in value:
        return value["count"] / value["n"] if value["n"] else None
    return value.get("value")


def _cell(metric: Metric, quality: str, value: Value) -> str:
    known = number(value)
    if known is None:
        return NOTHING
    text = f"{value['count']}/{value['n']}" if "count" in value else f"{known:.3g}"
    return f"**{text}**" if metric.falls_short(quality, value) else text


def _asked(bounds: tuple[float, float] | None) -> str:
    if bounds is None:
        return NOTHING
    low, high = bounds
    if high == float("inf"):
        return f"≥ {low:g}"
    return f"≤ {high:g}" if low == -float("inf") else f"{low:g} … {high:g}"


def _at(score: dict[str, Any], keys: Sequence[str]) -> Any:
    for key in keys:
        score = score[key]
    return score
