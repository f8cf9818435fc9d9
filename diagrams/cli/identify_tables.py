"""What `np-drake identify` prints and writes as JSON."""

from typing import TYPE_CHECKING, Any

from diagrams.cli.output import Table

if TYPE_CHECKING:
    from np_drake.identification.identify import Identification
    from np_drake.identification.validation import HeldOut


def table(found: "Identification") -> Table:
    """Return the table of what is told."""
    from diagrams.identification.text import agreement, half_width, interval

    rows = [
        (
            q.name,
            interval(found, q)[0],
            half_width(found, q, q.low, q.high),
            half_width(found, q, *q.prior),
            "flights" if q.told else "prior",
            agreement(q),
        )
        for q in found.quantities
    ]
    several = len(found.models) > 1
    header = ["quantity", "value", "95 %", "prior", "told by", *["flights"] * several]
    return "vehicle", header, [row[: len(header)] for row in rows]


def rate_loop(found: "Identification") -> Table:
    """Return the table of an autopilot's rate loop."""
    rows = [
        (
            axis,
            1e3 * one.lag,
            _ends(1e3 * one.lag_interval[0], 1e3 * one.lag_interval[1]),
            one.gain,
            _ends(*one.gain_interval),
            f"{100 * one.share:.0f} %",
        )
        for axis, one in zip(("roll", "pitch", "yaw"), found.rate_loop, strict=True)
    ]
    header = ["axis", "lag [ms]", "95 %", "gain [1]", "95 %", "explains"]
    return (
        "rate loop: when 63 % of a step of the command is followed, and rate over command",
        header,
        rows,
    )


def _ends(low: float, high: float) -> str:
    return f"{low:.3g} to {high:.3g}"


def judged(found: "Identification", rows: "list[HeldOut]") -> Table:
    """Return the table of errors on what was not fitted."""
    import numpy as np

    def size(values: Any) -> float:
        return float(np.sqrt(np.sum(np.square(values))))

    names = list(dict.fromkeys(row.flight for row in rows))
    several = len(names) > 1
    cells: list[tuple[Any, ...]] = []
    for row in rows:
        angles = np.rad2deg(row.open_loop[:, 2])
        first = [row.flight] * several
        cells.append(
            (*first, row.model, size(row.force), size(row.torque), *row.open_loop[:, 0], *angles)
        )
    errors = ["0.1 s [m]", "0.5 s [m]", "0.1 s [deg]", "0.5 s [deg]"]
    over = "/kg" if found.basis.ratios else ""
    header = [*["flight"] * several, "model", f"force [N{over}]", f"torque [N·m{over}]", *errors]
    which = "held out" if several else f"held out, {names[0]}"
    return f"{which}: RMS of the residual, median errors of open-loop prediction", header, cells


def as_json(found: "Identification", rows: "list[HeldOut]") -> dict[str, Any]:
    """Return the values of `--json`."""
    from diagrams.identification.text import not_told, unit_of
    from np_drake.identification.flight_agreement import flight_values, own_values

    each = {told.quantity.name: told for told in flight_values(found)}
    quantities = []
    for q in found.quantities:
        told = each.get(q.name)
        quantities.append(
            {
                "name": q.name,
                "field": q.quantity.field,
                "index": list(q.quantity.index),
                "unit": unit_of(found, q),
                "value": q.value,
                "ci95": [q.low, q.high],
                "prior95": list(q.prior),
                "told": q.told,
                "agreement": _finite(q.p),
                "flights": []
                if told is None
                else [
                    [_finite(v) for v in row]
                    for row in zip(told.value, told.low, told.high, strict=True)
                ],
                "apart": [] if told is None else list(told.apart),
            }
        )
    return {
        "ratios": found.basis.ratios,
        "fitted": [model.flight.name for model in found.models],
        "quantities": quantities,
        "by_flight": [
            {
                "name": own.quantity.name,
                "unit": own.quantity.quantity.unit,
                "agreement": own.quantity.p,
                "flights": [
                    list(map(float, row)) for row in zip(own.value, own.low, own.high, strict=True)
                ],
                "apart": list(own.apart),
            }
            for own in own_values(found)
        ],
        "rate_loop": [
            {
                "axis": axis,
                "lag": one.lag,
                "lag95": list(one.lag_interval),
                "gain": one.gain,
                "gain95": list(one.gain_interval),
                "share": one.share,
            }
            for axis, one in zip("xyz", found.rate_loop, strict=False)
        ],
        "not_told": [
            {"names": names, "because": why, "manoeuvre": way}
            for way, names, why in not_told(found)
        ],
        "held_out": [
            {
                "flight": r.flight,
                "model": r.model,
                "force": list(map(float, r.force)),
                "torque": list(map(float, r.torque)),
                "open_loop": [[_finite(x) for x in row] for row in r.open_loop],
            }
            for r in rows
        ],
    }


def _finite(value: float) -> float | None:
    return float(value) if value == value and abs(value) != float("inf") else None
