"""Tables of the real flights with known causes, within the width of a page."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from diagrams.batch.run import Table
from diagrams.challenge.real.calibration import calibration_table
from diagrams.challenge.real.campaigns import CAMPAIGNS, campaign_of
from diagrams.challenge.real.score import BIC, TOLD
from diagrams.challenge.real.summary import (
    Answer,
    Record,
    answers,
    asked_figures,
    beyond_drag,
    estimate,
    gains_nothing,
    is_covered,
    is_within,
    judged_names,
    methods_of,
)
from diagrams.challenge.real.truth import NAMED, PAYLOAD, WINDS
from diagrams.studies.columns import Column, tabulate
from np_drake.files.number_text import NOTHING

TOP = 5  # names that are shown of a method


def tables(records: Sequence[Record]) -> list[Table]:
    """Return all tables that the cases give, what is asked first, the names of every case last."""
    series = {name: judged_names(records, name) for name in methods_of(records, "naming")}
    found = [
        _asked_table(records),
        _group_table(records),
        _parameter_table(records),
        calibration_table(series),
        _payload_table(records),
        _wind_table(records),
        _name_table(records),
    ]
    return [table for table in found if table[2]]


def _asked_table(records: Sequence[Record]) -> Table:
    """Return what is asked beside what every method gives."""
    lines = asked_figures(records)
    used = [method for method in methods_of(records) if any(method in line for line in lines)]
    columns: list[Column] = [
        ("asked", "what"),
        ("wanted", "wanted"),
        *((method, _of_method(method)) for method in used),
    ]
    title = (
        "asked of the diagnosis; BIC: forward selection; told: least squares of the known "
        "effect alone"
    )
    return tabulate(title, lines, columns)


def _of_method(method: str) -> Callable[[Mapping[str, Any]], str]:
    return lambda line: line.get(method, NOTHING)


def _group_table(records: Sequence[Record]) -> Table:
    """Return counts of the cases by group and method."""
    lines = [
        (campaign, method, own)
        for campaign in CAMPAIGNS
        for method in methods_of(records, "naming")
        if (own := answers(records, [campaign.group], [method]))
    ]

    def count(figure: Callable[[Answer], Any]) -> Callable[[tuple], str]:
        def cell(line: tuple) -> str:
            known = [value for answer in line[2] if (value := figure(answer)) is not None]
            return str(sum(known)) if known else NOTHING

        return cell

    def beyond(line: tuple) -> str:
        counts = [beyond_drag(answer) for answer in line[2]]
        return f"{np.median(counts):g} / {np.mean(counts):.1f}"

    def seconds(line: tuple) -> str:
        known = [a["seconds"] for a in line[2] if a.get("seconds") is not None]
        return f"{np.median(known):.0f} / {max(known):.0f}" if known else NOTHING

    columns = (
        ("group", lambda line: line[0].group),
        ("by", lambda line: line[1]),
        ("n", lambda line: len(line[2])),
        ("right", count(lambda a: a["right"])),
        ("false", count(lambda a: bool(a["wrong"]))),
        ("beyond", beyond),
        ("worse", count(gains_nothing)),
        ("unk.", count(lambda a: a["unknown"] > NAMED if "unknown" in a else None)),
        ("s", seconds),
    )
    title = (
        "cases: known cause named and no false name; with a false name; names beyond drag, "
        "median / mean; named, and "
        "held out worse; unknown; seconds, median / most"
    )
    return tabulate(title, lines, columns)


def _parameter_table(records: Sequence[Record]) -> Table:
    """Return errors and coverage of the parameters of known causes, by group and method."""
    lines = [
        (campaign, name, method, own)
        for campaign in CAMPAIGNS
        for name in campaign.truth.parameters
        for method in methods_of(records)
        if (own := [a for a in answers(records, [campaign.group], [method]) if estimate(name, a)])
    ]

    def errors(line: tuple) -> str:
        campaign, name, _, own = line
        known = [
            (v, campaign.truth.parameters[name].value)
            for a in own
            if (v := estimate(name, a)["value"]) is not None
        ]
        found = [100 * (value / true - 1) for value, true in known]
        return f"{np.median(found):+.0f} / {max(found, key=abs):+.0f}" if found else NOTHING

    def asked(line: tuple) -> str:
        own = line[0].truth.parameters[line[1]]
        return f"{own.low:.2g} to {own.high:.2g}"

    columns = (
        ("group", lambda line: line[0].group),
        ("parameter", lambda line: line[1]),
        ("asked", asked),
        ("by", lambda line: line[2]),
        ("told", lambda line: len(line[3])),
        ("in range", lambda line: sum(is_within(line[1], a) for a in line[3])),
        ("covered", lambda line: sum(is_covered(line[1], a) for a in line[3])),
        ("error [%]", errors),
    )
    return tabulate(
        "parameters of known causes [SI]; covered: by the 95 % interval; error: median / largest",
        lines,
        columns,
    )


def _payload_table(records: Sequence[Record]) -> Table:
    """Return mass, length and position of the payload by case and method, with 95 % intervals."""
    title = (
        "payload; position: RMSE observed and open loop; cut: held-out residual, lateral / "
        "vertical / torque"
    )
    groups = [c.group for c in CAMPAIGNS if PAYLOAD in c.truth.present]
    columns = (
        ("case", lambda a: f"{a['group']}: {a['case']}"),
        ("by", "by"),
        ("p", lambda a: _fixed(a["causes"].get(PAYLOAD), 2)),
        ("mass [g]", lambda a: _interval(a, "mass", 1e3, 1)),
        ("length [m]", lambda a: _interval(a, "length", 1.0, 3)),
        ("obs. [cm]", lambda a: _fixed(a.get("position", {}).get("observed"), 1, 100.0)),
        ("open", lambda a: _fixed(a.get("position", {}).get("open"), 1, 100.0)),
        ("cut [%]", lambda a: _cut(a, "lateral", "vertical", "torque")),
    )
    return tabulate(title, answers(records, groups, _telling(records)), columns)


def _wind_table(records: Sequence[Record]) -> Table:
    """Return direction, force and speed of the wind by case and method."""

    def figure(name: str, digits: int):
        return lambda a: _fixed(a.get("wind", {}).get(name), digits)

    def probability(answer: Answer) -> str:
        if answer["by"] == TOLD:
            return NOTHING
        return f"{max(answer['causes'].get(wind, 0.0) for wind in WINDS):.2f}"

    columns = (
        ("case", "case"),
        ("by", "by"),
        ("p", probability),
        ("fans [m/s]", lambda a: f"{a['fans']:.1f}"),
        ("off [deg]", figure("angle", 0)),
        ("force", figure("force", 2)),
        ("speed", figure("speed", 2)),
        ("up [m/s]", figure("up", 1)),
        ("cut [%]", lambda a: _cut(a, "lateral", "vertical")),
    )
    title = (
        "wind along -x; force over that measured against still air, speed over that of the fans [1]"
    )
    return tabulate(title, answers(records, ["wind"], _telling(records)), columns)


def _name_table(records: Sequence[Record]) -> Table:
    """Return the most probable names of every case and method; wrong ones in capitals."""
    columns = (
        ("case", lambda a: f"{a['group']}: {a['case']}"),
        ("by", "by"),
        ("right", lambda a: "yes" if a["right"] else "no"),
        ("names", _names),
        ("s", lambda a: _fixed(a.get("seconds"), 0)),
    )
    title = (
        f"names and probabilities, the first {TOP}; WRONG ones in capitals, those above "
        f"{NAMED:g} count"
    )
    return tabulate(title, answers(records, methods=methods_of(records, "naming")), columns)


def _telling(records: Sequence[Record]) -> list[str]:
    """Return the methods that tell parameters."""
    return [method for method in methods_of(records) if method != BIC]


def _names(answer: Answer) -> str:
    truth, late = campaign_of(answer["group"]).truth, answer["late"]
    found = sorted(answer["causes"].items(), key=lambda pair: -pair[1])
    parts = [f"{n.upper() if truth.holds(n, late) is False else n} {p:.2f}" for n, p in found[:TOP]]
    more = [f"and {len(found) - TOP} more"] if len(found) > TOP else []
    hint = ["says what is new"] if answer.get("new_condition") else []
    return ", ".join([*parts, *more, *hint]) or "nothing"


def _cut(answer: Answer, *groups: str) -> str:
    """Return by how much the held-out residual is reduced, in per cent, by group of channels."""
    return " / ".join(_fixed(answer.get("cut", {}).get(group), 0, 100.0) for group in groups)


def _interval(answer: Answer, name: str, factor: float, digits: int) -> str:
    """Return a parameter of the payload as `4.1 [3.6, 4.5]`."""
    own = estimate(name, answer)
    bounds = own.get("ci95") or (None, None)
    value, low, high = (_fixed(number, digits, factor) for number in (own.get("value"), *bounds))
    return f"{value} [{low}, {high}]" if own else NOTHING


def _fixed(value: float | None, digits: int, factor: float = 1.0) -> str:
    return NOTHING if value is None or value != value else f"{factor * value:.{digits}f}"
