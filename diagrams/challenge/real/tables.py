"""Tables of the real flights with known causes, within the width of a page."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from diagrams.batch.columns import Column, tabulate
from diagrams.batch.run import Table
from diagrams.challenge.real.score import METHODS, THIS, TOLD
from diagrams.challenge.real.summary import NAMING, PAYLOADS, Answer, Record, answers, asked_figures
from diagrams.challenge.real.truth import NAMED, TRUTHS, WINDS
from np_drake.files.number_text import NOTHING

TOP = 5  # names that are shown of a method


def tables(records: Sequence[Record]) -> list[Table]:
    """Return all tables that the cases give: what is asked, payloads, winds, and names of every case."""
    found = [_asked_table(records), _payload_table(records), _wind_table(records), _name_table(records)]
    return [table for table in found if table[2]]


def _asked_table(records: Sequence[Record]) -> Table:
    """Return what is asked beside what every method gives."""
    lines = asked_figures(records)
    used = [method for method in METHODS if any(method in line for line in lines)]
    columns: list[Column] = [
        ("asked", "what"),
        ("wanted", "wanted"),
        *((method, _of_method(method)) for method in used),
    ]
    title = "asked of the diagnosis; BIC: forward selection; told: least squares of the known effect alone"
    return tabulate(title, lines, columns)


def _of_method(method: str) -> Callable[[Mapping[str, Any]], str]:
    return lambda line: line.get(method, NOTHING)


def _payload_table(records: Sequence[Record]) -> Table:
    """Return mass, length and position of the payload by case and method, with 95 % intervals."""
    mass, length = (TRUTHS["payload"].parameters[name].value for name in ("mass", "length"))
    title = (
        f"payload: {1e3 * mass:g} g, {length:g} m; position: RMSE observed and open loop; cut: held-out residual, "
        "lateral / vertical / torque"
    )
    columns = (
        ("case", lambda a: a["case"] + (" (command)" if a["group"] == PAYLOADS[1] else "")),
        ("by", "by"),
        ("p", lambda a: _fixed(a["causes"].get("suspended_payload"), 2)),
        ("mass [g]", lambda a: _interval(a, "mass", 1e3, 1)),
        ("length [m]", lambda a: _interval(a, "length", 1.0, 3)),
        ("obs. [cm]", lambda a: _fixed(a.get("position", {}).get("observed"), 1, 100.0)),
        ("open", lambda a: _fixed(a.get("position", {}).get("open"), 1, 100.0)),
        ("cut [%]", lambda a: _cut(a, "lateral", "vertical", "torque")),
    )
    return tabulate(title, answers(records, PAYLOADS, (THIS, TOLD)), columns)


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
    title = "wind along -x; force over that measured against still air, speed over that of the fans [1]"
    return tabulate(title, answers(records, ["wind"], (THIS, TOLD)), columns)


def _name_table(records: Sequence[Record]) -> Table:
    """Return the most probable names of every case and method; wrong ones in capitals."""
    columns = (
        ("case", lambda a: f"{a['group']}: {a['case']}"),
        ("by", "by"),
        ("right", lambda a: "yes" if a["right"] else "no"),
        ("names", _names),
        ("s", lambda a: _fixed(a.get("seconds"), 0)),
    )
    title = f"names and probabilities, the first {TOP}; WRONG ones in capitals, those above {NAMED:g} count"
    return tabulate(title, answers(records, methods=NAMING), columns)


def _names(answer: Answer) -> str:
    truth = TRUTHS[answer["group"]]
    found = sorted(answer["causes"].items(), key=lambda pair: -pair[1])
    parts = [f"{n.upper() if truth.holds(n) is False else n} {p:.2f}" for n, p in found[:TOP]]
    more = [f"and {len(found) - TOP} more"] if len(found) > TOP else []
    hint = ["says what is new"] if answer.get("new_condition") else []
    return ", ".join([*parts, *more, *hint]) or "nothing"


def _cut(answer: Answer, *groups: str) -> str:
    """Return by how much the held-out residual is reduced, in per cent, by group of channels."""
    return " / ".join(_fixed(answer.get("cut", {}).get(group), 0, 100.0) for group in groups)


def _interval(answer: Answer, name: str, factor: float, digits: int) -> str:
    """Return a parameter of the payload as `4.1 [3.6, 4.5]`."""
    own: dict[str, Any] | None = answer["parameters"].get("suspended_payload", {}).get(name)
    if own is None:
        return NOTHING
    value, low, high = (f"{factor * number:.{digits}f}" for number in (own["value"], *own["ci95"]))
    return f"{value} [{low}, {high}]"


def _fixed(value: float | None, digits: int, factor: float = 1.0) -> str:
    return NOTHING if value is None or value != value else f"{factor * value:.{digits}f}"
