"""Tables of the real flights with known causes, within the width of a page."""

from collections.abc import Iterable, Sequence
from typing import Any

from diagrams.challenge.real.score import BIC, METHODS, TOLD
from diagrams.challenge.real.summary import PAYLOADS, Record, asked_figures
from diagrams.challenge.real.truth import NAMED, TRUTHS

Table = tuple[str, list[str], list[tuple]]
TOP = 5  # names that are shown of a method


def tables(records: Sequence[Record]) -> list[Table]:
    """Return all tables that the cases give: what is asked, payloads, winds, and names of every case."""
    found = [asked_table(records), payload_table(records), wind_table(records), name_table(records)]
    return [table for table in found if table[2]]


def asked_table(records: Sequence[Record]) -> Table:
    """Return what is asked beside what every method gives."""
    lines = asked_figures(records)
    used = [m for m in METHODS if any(line.get(m) is not None for line in lines)]
    rows = [
        (line["what"], line["wanted"], *(line.get(m) or "–" for m in used))
        for line in lines
        if any(line.get(m) is not None for m in used)
    ]
    title = "asked of the diagnosis; BIC: forward selection; told: least squares of the known effect alone"
    return title, ["asked", "wanted", *used], rows


def payload_table(records: Sequence[Record]) -> Table:
    """Return mass, length and position of the payload by case and method, with 95 % intervals."""
    rows = []
    for record in _of(records, PAYLOADS):
        for name, method in record["methods"].items():
            own = method["parameters"].get("suspended_payload")
            if own is None and name == BIC:
                continue
            p = method["causes"].get("suspended_payload")
            at, cut = method.get("position", {}), method.get("cut", {})
            rows.append(
                (
                    record["case"] + (" (command)" if record["group"] == PAYLOADS[1] else ""),
                    name,
                    "–" if p is None else f"{p:.2f}",
                    _interval(own, "mass", 1e3, 1),
                    _interval(own, "length", 1.0, 3),
                    _fixed(at.get("observed"), 1, 100.0),
                    _fixed(at.get("open"), 1, 100.0),
                    " / ".join(_fixed(cut.get(k), 0, 100.0) for k in ("lateral", "vertical", "torque")),
                )
            )
    mass, length = (TRUTHS["payload"].parameters[k].value for k in ("mass", "length"))
    title = (
        f"payload: {1e3 * mass:g} g, {length:g} m; position: RMSE observed and open loop; cut: held-out residual, "
        "lateral / vertical / torque"
    )
    return title, ["case", "by", "p", "mass [g]", "length [m]", "obs. [cm]", "open", "cut [%]"], rows


def wind_table(records: Sequence[Record]) -> Table:
    """Return direction, force and speed of the wind by case and method."""
    rows = []
    for record in _of(records, ["wind"]):
        for name, method in record["methods"].items():
            own = method.get("wind") or {}
            if not own and name == BIC:
                continue
            p = max((method["causes"].get(w, 0.0) for w in ("constant_wind", "gusty_wind")), default=0.0)
            cut = method.get("cut", {})
            rows.append(
                (
                    record["case"],
                    name,
                    "–" if name == TOLD else f"{p:.2f}",
                    f"{record['wind']:.1f}",
                    _fixed(own.get("angle"), 0),
                    _fixed(own.get("force"), 2),
                    _fixed(own.get("speed"), 2),
                    _fixed(own.get("up"), 1),
                    " / ".join(_fixed(cut.get(k), 0, 100.0) for k in ("lateral", "vertical")),
                )
            )
    title = "wind along -x; force over that measured against still air, speed over that of the fans [1]"
    header = ["case", "by", "p", "fans [m/s]", "off [deg]", "force", "speed", "up [m/s]", "cut [%]"]
    return title, header, rows


def name_table(records: Sequence[Record]) -> Table:
    """Return the most probable names of every case and method; wrong ones in capitals."""
    rows = []
    for record in records:
        for name, method in record["methods"].items():
            if name == TOLD:
                continue
            said = "yes" if method.get("right") else "no"
            rows.append(
                (
                    f"{record['group']}: {record['case']}",
                    name,
                    said,
                    _names(record, method),
                    _last(method),
                )
            )
    title = f"names and probabilities, the first {TOP}; WRONG ones in capitals, those above {NAMED:g} count"
    return title, ["case", "by", "right", "names", "s"], rows


def _names(record: Record, method: dict[str, Any]) -> str:
    truth = TRUTHS[record["group"]]
    found = sorted(method["causes"].items(), key=lambda pair: -pair[1])
    parts = [f"{n.upper() if truth.holds(n) is False else n} {p:.2f}" for n, p in found[:TOP]]
    more = [f"and {len(found) - TOP} more"] if len(found) > TOP else []
    hint = ["says what is new"] if method.get("new_condition") else []
    return ", ".join([*parts, *more, *hint]) or "nothing"


def _last(method: dict[str, Any]) -> str:
    return _fixed(method.get("seconds"), 0)


def _of(records: Sequence[Record], groups: Iterable[str]) -> list[Record]:
    return [record for record in records if record["group"] in set(groups)]


def _interval(own: dict[str, Any] | None, name: str, factor: float, digits: int) -> str:
    """Return `4.1 [3.6, 4.5]`."""
    if not own or name not in own:
        return "–"
    low, high = own[name]["ci95"]
    value, low, high = (factor * v for v in (own[name]["value"], low, high))
    return f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def _fixed(value: float | None, digits: int, factor: float = 1.0) -> str:
    return "–" if value is None or value != value else f"{factor * value:.{digits}f}"
