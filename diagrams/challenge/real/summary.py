"""Figures that are asked of the diagnosis on real flights, over all cases, by method."""

import dataclasses as dc
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from diagrams.challenge.real.score import BIC, METHODS, THIS
from diagrams.challenge.real.truth import (
    DRAG,
    EXCLUDED_BESIDE_WIND,
    LINEAR_UP_TO,
    SURE,
    TRUTHS,
    WINDS,
    WITHIN_ANGLE,
    WITHIN_FORCE,
    WITHIN_POSITION,
    WITHIN_SPEED,
    named,
)

Record = Mapping[str, Any]  # of `score_case`
Answer = Mapping[str, Any]  # score of a method in a case, see `answers`
PAYLOADS, ALL = ("payload", "payload-command"), tuple(TRUTHS)
NAMING = (THIS, BIC)  # methods that give probabilities
TETHERED, KNOWN = "suspended_payload", TRUTHS["payload"].parameters


def answers(records: Sequence[Record], groups: Collection[str] = ALL, methods: Sequence[str] = METHODS) -> list[Answer]:
    """Return the scores of methods in the cases of some groups, with "group", "case", "by" and "fans" of each.

    Args:
        records: of `score_case`.
        groups: groups of cases.
        methods: names of methods; one that did not answer a case is left out there.
    """
    return [
        {
            "group": record["group"],
            "case": record["case"],
            "by": method,
            "fans": record.get("wind"),
            **record["methods"][method],
        }
        for record in records
        if record["group"] in groups
        for method in methods
        if method in record["methods"]
    ]


def _count(values: Sequence[bool]) -> str:
    return f"{sum(values)} of {len(values)}"


def _median_seconds(values: Sequence[float]) -> str:
    return f"{np.median(values):.1f}"


def _centimetres(values: Sequence[float]) -> str:
    return f"{100 * np.median(values):.1f}, max {100 * max(values):.1f}"


@dc.dataclass(frozen=True)
class Asked:
    """Line of the table: what is asked of the cases of some groups.

    figure: of an answer; None: it does not count.   methods: of which it is asked.   gather: cell of all figures.
    """

    what: str
    wanted: str
    groups: Collection[str]
    figure: Callable[[Answer], Any]
    methods: Sequence[str] = METHODS
    gather: Callable[[list], str] = _count

    def cell(self, records: Sequence[Record], method: str) -> str | None:
        """Return the cell of a method; None where it has no figure.

        Args:
            records: of `score_case`.
            method: name of the method.
        """
        if method not in self.methods:
            return None
        figures = [self.figure(answer) for answer in answers(records, self.groups, [method])]
        known = [figure for figure in figures if figure is not None]
        return self.gather(known) if known else None


def asked_figures(records: Sequence[Record]) -> list[dict[str, Any]]:
    """Return lines with what is asked, what is wanted, and what each method gives, where one gives anything."""
    lines = []
    for asked in _asked():
        cells = {method: cell for method in METHODS if (cell := asked.cell(records, method)) is not None}
        if cells:
            lines.append({"what": asked.what, "wanted": asked.wanted, **cells})
    return lines


def _asked() -> Iterator[Asked]:
    yield from _of_payloads("payload", "payload")
    yield from _of_payloads("payload-command", "payload, command")
    yield _false_names("bare", "bare: cases with a false name")
    yield _false_names("neurobem", "neurobem: cases with a false name")
    yield from _of_wind()
    yield _false_names("still", "still air: cases with a false name")
    yield _false_names("new-wind", "still fitted, windy held out: with a false name")
    what = "still fitted, windy held out: says so"
    yield Asked(what, "all", ["new-wind"], lambda a: bool(a["new_condition"]), [THIS])
    known = [group for group in ALL if group != "neurobem"]
    yield Asked("known cause: right", f"more than {BIC}", known, lambda a: a["right"], NAMING)
    what = f"all: names that are wrong, p > {SURE:g}"
    yield Asked(what, "0", ALL, _sure_and_wrong, NAMING, lambda counts: str(sum(counts)))
    yield Asked("seconds a case, median", "", ALL, lambda a: a["seconds"], [THIS], _median_seconds)


def _false_names(group: str, what: str) -> Asked:
    return Asked(what, "0", [group], lambda a: bool(a["wrong"]), NAMING)


def _sure_and_wrong(answer: Answer) -> int:
    return sum(answer["causes"][name] > SURE for name in answer["wrong"])


def _of_payloads(group: str, title: str) -> Iterator[Asked]:
    named_for_sure = f"{title}: named, p ≥ {SURE:g}"
    yield Asked(named_for_sure, "≥ 95 %", [group], lambda a: a["causes"].get(TETHERED, 0.0) >= SURE, NAMING)
    for name, known in KNOWN.items():
        yield Asked(f"{title}: {name} within {100 * known.within:.0f} %", "all", [group], partial(_is_within, name))
    both = f"{title}: both in the 95 % interval"
    yield Asked(both, "≥ 90 %", [group], lambda a: all(_is_covered(name, a) for name in KNOWN))
    most = f"≤ {100 * WITHIN_POSITION:.0f}"
    for key, how in (("observed", "observed"), ("open", "open loop")):
        what = f"{title}: position, {how}, RMSE [cm]"
        yield Asked(what, most, [group], partial(_position_error, key), gather=_centimetres)


def _position_error(key: str, answer: Answer) -> float | None:
    return answer.get("position", {}).get(key)


def _is_within(name: str, answer: Answer) -> bool:
    """Return whether a parameter of the payload is within the asked error; False where it has none."""
    found, known = answer["parameters"].get(TETHERED, {}).get(name), KNOWN[name]
    return found is not None and abs(found["value"] / known.value - 1) <= known.within


def _is_covered(name: str, answer: Answer) -> bool:
    """Return whether the 95 % interval of a parameter of the payload holds the truth; False where there is none."""
    found = answer["parameters"].get(TETHERED, {}).get(name)
    return found is not None and found["ci95"][0] <= KNOWN[name].value <= found["ci95"][1]


def _of_wind() -> Iterator[Asked]:
    of_wind = partial(Asked, wanted="all", groups=["wind"])
    yield of_wind("wind: with drag, no mass or clock error", figure=_wind_is_named, methods=NAMING)
    what = f"wind: direction within {WITHIN_ANGLE:.0f}°"
    yield of_wind(what, figure=partial(_wind_is_within, "angle", 0.0, WITHIN_ANGLE))
    what = f"wind: mean force within {100 * WITHIN_FORCE:.0f} %"
    yield of_wind(what, figure=partial(_wind_is_within, "force", 1.0, WITHIN_FORCE))
    what = f"wind below {LINEAR_UP_TO:.0f} m/s: speed within {100 * WITHIN_SPEED:.0f} %"
    yield of_wind(what, figure=_gentle_speed_is_within)


def _wind_is_named(answer: Answer) -> bool:
    """Return whether a wind and a linear drag are named, and no mass or clock error beside them."""
    names = set(named(answer["causes"]))
    return bool(names & set(WINDS)) and DRAG in names and not names & set(EXCLUDED_BESIDE_WIND)


def _wind_is_within(figure: str, about: float, within: float, answer: Answer) -> bool:
    """Return whether a figure of the wind is within the asked error; False where no wind is told."""
    value = answer.get("wind", {}).get(figure)
    return value is not None and abs(value - about) <= within


def _gentle_speed_is_within(answer: Answer) -> bool | None:
    """Return whether the speed of the wind is within the asked error; None where the fans blow harder."""
    return _wind_is_within("speed", 1.0, WITHIN_SPEED, answer) if answer["fans"] <= LINEAR_UP_TO else None


def judged_names(records: Sequence[Record], method: str = THIS) -> list[tuple[float, bool]]:
    """Return probability and truth of every name of which the truth is known.

    Args:
        records: of `score_case`.
        method: name of the method that gave the names.
    """
    return [
        pair
        for answer in answers(records, methods=[method])
        for pair in TRUTHS[answer["group"]].judged(answer["causes"])
    ]
