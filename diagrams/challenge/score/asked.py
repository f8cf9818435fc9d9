"""Figures of a score beside what is asked for."""

import dataclasses as dc
from typing import Any

from diagrams.batch.run import Table
from diagrams.challenge.score.tables import NOTHING, at

QUALITIES = ("clean", "real", "wild")
INFINITY = float("inf")
Value = (
    dict[str, Any] | float | None
)  # a share with `count` and `n`, or a number; None where there are no cases


@dc.dataclass(frozen=True)
class Asked:
    """A figure of a score, and the least and most that are asked for by quality [1]; None: nothing
    is.
    """

    label: str
    keys: str  # under which it stands in a score, with dots between
    clean: tuple[float, float] | None = None
    real: tuple[float, float] | None = None
    wild: tuple[float, float] | None = None

    def cells(self, quality: str, value: Value) -> tuple[str, str, str]:
        """Return its row: label, what is asked for, and the value, between asterisks where it falls
        short.
        """
        if isinstance(value, dict):
            known = value["count"] / value["n"] if value["n"] else None
            text = f"{value['count']}/{value['n']}"
        else:
            known, text = value, f"{value or 0.0:.3g}"
        bounds = getattr(self, quality)
        if known is None:
            text = NOTHING
        elif bounds is not None and not bounds[0] <= known <= bounds[1]:
            text = f"**{text}**"
        return self.label, _range(bounds), text


def _range(bounds: tuple[float, float] | None) -> str:
    if bounds is None:
        return NOTHING
    low, high = bounds
    if high == INFINITY:
        return f"≥ {low:g}"
    return f"≤ {high:g}" if low == -INFINITY else f"{low:g} … {high:g}"


def _least(*bounds: float) -> list[tuple[float, float]]:
    return [(bound, INFINITY) for bound in bounds]


def _most(*bounds: float) -> list[tuple[float, float]]:
    return [(-INFINITY, bound) for bound in bounds]


ASKED = (
    Asked("single: right class", "rates.single.class", *_least(0.98, 0.88, 0.85)),
    Asked("right name, nothing else", "rates.single.exact", *_least(0.93, 0.80)),
    Asked("pairs and triples: F1", "rates.several.all.f1", *_least(0.92, 0.75)),
    Asked("`unknown` added to them", "rates.several.unknown", *_most(0.1, 0.1, 0.1)),
    Asked("clean controls: false alarm", "rates.clean.false_alarm", *_most(0.01, 0.03, 0.02)),
    Asked("foreign: `unknown`", "rates.foreign.unknown", *_least(0.92, 0.75, 0.85)),
    Asked("a wrong name above 0.9", "rates.foreign.wrong_and_sure", *_most(0.0, 0.02)),
    Asked("parameters: median error", "parameters.median_error", *_most(0.03, 0.08)),
    Asked(
        "in the 95 % interval", "parameters.coverage_rate", (0.90, 0.99), (0.88, 0.99), (0.90, 0.98)
    ),
    Asked("onset within 0.2 s", "onset.within", *_least(0.90, 0.75)),
    Asked("where it shows", "onset.within_if_seen"),
    Asked("where the true effect tells", "onset.within_if_told"),
    Asked("shrink, mean", "shrink_relative.mean", *_least(0.95, 0.85)),
    Asked("true parameters, not every gust", "shrink_relative_parameters.mean"),
    Asked("half are found at visibility", "detection.half", *_most(1.1, 1.3)),
    Asked("calibration error", "reliability.ece", wild=(-INFINITY, 0.05)),
    Asked("replay, 1 s: reduction", "replay.median_reduction", *_least(0.70, 0.70)),
)


def asked_tables(score: dict[str, Any]) -> list[Table]:
    """Return, by quality that a score has cases of, what is asked for beside what it has."""
    groups = score["groups"] or {score["sets"][0]["group"]: score}
    parts = score["qualities"] or {group.rsplit(", ", 1)[1]: part for group, part in groups.items()}
    return [
        (
            f"asked of `{quality}`; short ones between asterisks",
            ["figure", "asked", quality],
            [
                figure.cells(quality, at(parts[quality], figure.keys))
                for figure in ASKED
                if getattr(figure, quality) is not None
            ],
        )
        for quality in QUALITIES
        if quality in parts
    ]
