"""Figures that are asked of the diagnosis on real flights, over all cases, by method."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import itemgetter
from typing import Any

import numpy as np

from diagrams.challenge.real.score import BIC, THIS
from diagrams.challenge.real.truth import (
    EXCLUDED_BESIDE_WIND,
    LINEAR_UP_TO,
    SURE,
    TRUTHS,
    WINDS,
    WITHIN_ANGLE,
    WITHIN_FORCE,
    WITHIN_POSITION,
    WITHIN_SPEED,
    Known,
    judged,
    named,
    wrong,
)

Record = Mapping[str, Any]
Method = Mapping[str, Any]
PAYLOADS, ALL = ("payload", "payload-command"), tuple(TRUTHS)
LEAST_SHARE = {"named": 0.95, "interval": 0.90}  # of cases, that is asked


def of_group(records: Sequence[Record], groups: Iterable[str], method: str) -> list[tuple[Record, Method]]:
    """Return the cases of some groups that a method answered."""
    wanted = set(groups)
    return [(r, r["methods"][method]) for r in records if r["group"] in wanted and method in r["methods"]]


def payload_named(method: Method) -> bool:
    """Return whether the payload is named for sure."""
    return "suspended_payload" in named(method["causes"], SURE)


def parameter_within(method: Method, effect: str, name: str, known: Known) -> bool:
    """Return whether the value of a parameter is within the asked error; False where it has none."""
    found = method["parameters"].get(effect, {}).get(name)
    return found is not None and abs(found["value"] / known.value - 1) <= known.within


def parameter_covered(method: Method, effect: str, name: str, known: Known) -> bool:
    """Return whether the true value lies in the 95 % interval; False where there is none."""
    found = method["parameters"].get(effect, {}).get(name)
    return found is not None and found["ci95"][0] <= known.value <= found["ci95"][1]


def wind_named(method: Method) -> bool:
    """Return whether a wind and a linear drag are named, and no mass or clock error beside them."""
    names = set(named(method["causes"]))
    return bool(names & set(WINDS)) and "linear_drag" in names and not names & set(EXCLUDED_BESIDE_WIND)


def wind_within(method: Method, figure: str, asked: float, about: float = 1.0) -> bool:
    """Return whether a figure of the wind is within the asked error; False where no wind is told."""
    value = method.get("wind", {}).get(figure)
    return value is not None and abs(value - about) <= asked


def count(pairs: Sequence[tuple[Record, Method]], holds: Callable[[Method], bool]) -> str | None:
    """Return `12 of 26`; None without cases."""
    return f"{sum(holds(method) for _, method in pairs)} of {len(pairs)}" if pairs else None


def asked_figures(records: Sequence[Record]) -> list[dict[str, Any]]:
    """Return lines with what is asked, of which flights, what is wanted, and what each method gives."""
    return [line for make in (_payload, _bare, _wind, _still, _together) for line in make(records)]


def _line(
    records: Sequence[Record],
    what: str,
    wanted: str,
    groups: Iterable[str],
    holds: Callable[[Method], Any],
    methods: Sequence[str] | None = None,
    gather: Callable[[Sequence[tuple[Record, Method]], Callable[[Method], Any]], Any] = count,
) -> dict[str, Any]:
    line: dict[str, Any] = {"what": what, "wanted": wanted}
    for method in methods or _methods(records):
        line[method] = gather(of_group(records, groups, method), holds)
    return line


def _methods(records: Sequence[Record]) -> list[str]:
    return list(dict.fromkeys(name for record in records for name in record["methods"]))


def naming(records: Sequence[Record]) -> list[str]:
    """Return the methods that give probabilities."""
    return [m for m in _methods(records) if any(r["methods"].get(m, {}).get("causes") for r in records)]


def _payload(records: Sequence[Record]) -> list[dict[str, Any]]:
    known = TRUTHS["payload"].parameters
    lines = []
    for group, note in (("payload", ""), ("payload-command", ", command")):
        if not any(r["group"] == group for r in records):
            continue
        lines.append(
            _line(
                records,
                f"payload{note}: named, p ≥ {SURE:g}",
                "≥ 95 %",
                [group],
                payload_named,
                naming(records),
            )
        )
        for name, value in known.items():
            lines.append(
                _line(
                    records,
                    f"payload{note}: {name} within {100 * value.within:.0f} %",
                    "all",
                    [group],
                    lambda m, n=name, k=value: parameter_within(m, "suspended_payload", n, k),  # type: ignore[misc]
                )
            )
        lines.append(
            _line(
                records,
                f"payload{note}: both in the 95 % interval",
                "≥ 90 %",
                [group],
                lambda m: all(parameter_covered(m, "suspended_payload", n, k) for n, k in known.items()),
            )
        )
        for kind in ("observed", "open"):
            lines.append(
                _line(
                    records,
                    f"payload{note}: position, {kind}{' loop' if kind == 'open' else ''}, RMSE [cm]",
                    f"≤ {100 * WITHIN_POSITION:.0f}",
                    [group],
                    lambda m, k=kind: m.get("position", {}).get(k),  # type: ignore[misc]
                    gather=centimetres,
                )
            )
    return lines


def centimetres(
    pairs: Sequence[tuple[Record, Method]], figure: Callable[[Method], float | None]
) -> str | None:
    """Return median and maximum of a length over the cases that have one [cm]."""
    values = [value for _, method in pairs if (value := figure(method)) is not None]
    return f"{100 * np.median(values):.1f}, max {100 * max(values):.1f}" if values else None


def _bare(records: Sequence[Record]) -> list[dict[str, Any]]:
    return _false_names(records, "bare", "bare: cases with a false name") + _false_names(
        records, "neurobem", "neurobem: cases with a false name"
    )


def _false_names(records: Sequence[Record], group: str, what: str) -> list[dict[str, Any]]:
    if not any(r["group"] == group for r in records):
        return []
    return [_line(records, what, "0", [group], lambda m: bool(m["wrong"]), naming(records))]


def _wind(records: Sequence[Record]) -> list[dict[str, Any]]:
    if not any(r["group"] == "wind" for r in records):
        return []
    gentle = [r for r in records if r["group"] == "wind" and r["wind"] <= LINEAR_UP_TO]
    return [
        _line(
            records, "wind: with drag, no mass or clock error", "all", ["wind"], wind_named, naming(records)
        ),
        _line(
            records,
            f"wind: direction within {WITHIN_ANGLE:.0f}°",
            "all",
            ["wind"],
            lambda m: wind_within(m, "angle", WITHIN_ANGLE, 0.0),
        ),
        _line(
            records,
            f"wind: mean force within {100 * WITHIN_FORCE:.0f} %",
            "all",
            ["wind"],
            lambda m: wind_within(m, "force", WITHIN_FORCE),
        ),
        _line(
            gentle,
            f"wind below {LINEAR_UP_TO:.0f} m/s: speed within {100 * WITHIN_SPEED:.0f} %",
            "all",
            ["wind"],
            lambda m: wind_within(m, "speed", WITHIN_SPEED),
        ),
    ]


def _still(records: Sequence[Record]) -> list[dict[str, Any]]:
    lines = _false_names(records, "still", "still air: cases with a false name")
    if any(r["group"] == "new-wind" for r in records):
        with_hook = [m for m in _methods(records) if m != BIC and m in naming(records)]
        lines += _false_names(records, "new-wind", "still fitted, windy held out: with a false name")
        lines.append(
            _line(
                records,
                "still fitted, windy held out: says so",
                "all",
                ["new-wind"],
                lambda m: bool(m.get("new_condition")),
                with_hook,
            )
        )
    return lines


def _together(records: Sequence[Record]) -> list[dict[str, Any]]:
    known = [g for g, truth in TRUTHS.items() if g != "neurobem" and truth.source]
    names = naming(records)
    timed = [m for m in _methods(records) if any("seconds" in r["methods"].get(m, {}) for r in records)]
    return [
        _line(records, "known cause: right", f"more than {BIC}", known, lambda m: m["right"], names),
        {
            "what": f"all: names that are wrong, p > {SURE:g}",
            "wanted": "0",
            **{m: str(_surely_wrong(records, m)) for m in names},
        },
        _line(records, "seconds a case, median", "", ALL, itemgetter("seconds"), timed, gather=seconds),
    ]


def _surely_wrong(records: Sequence[Record], method: str) -> int:
    return sum(
        len(wrong(TRUTHS[r["group"]], m["causes"], np.nextafter(SURE, 1)))
        for r, m in of_group(records, ALL, method)
    )


def seconds(pairs: Sequence[tuple[Record, Method]], figure: Callable[[Method], float | None]) -> str | None:
    """Return the median of the seconds of cases."""
    values = [value for _, method in pairs if "seconds" in method and (value := figure(method)) is not None]
    return f"{np.median(values):.1f}" if values else None


def judged_names(records: Sequence[Record], method: str = THIS) -> list[tuple[float, bool]]:
    """Return probability and truth of every name of a method of which the truth is known."""
    pairs = of_group(records, ALL, method)
    return [pair for r, m in pairs for pair in judged(TRUTHS[r["group"]], m["causes"])]
