"""Tables of real sets: agreement of two halves of the flights, and errors on the half that was not
fitted.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from diagrams.batch.run import Table
from diagrams.studies.columns import tabulate
from np_drake.files.number_text import NOTHING
from np_drake.identification.validation import HORIZONS

NAMED = (  # quantities that are printed by name
    "thrust coefficient",
    "thrust at full throttle",
    "inertia xx",
    "inertia yy",
    "time constant up",
    "transport delay",
    "rotor speed at full throttle",
)
MODELS = ("vehicle file", "least squares", "identified")
Line = dict[str, Any]
Halves = Mapping[str, Sequence[Line]]  # by name of the set: the results of its two halves


def agreement_lines(sets: Halves) -> list[Line]:
    """Return a line a set: how many quantities both halves tell, and which differ by more than
    their joint interval.

    Args: sets: results of `HalfCase`.
    """
    lines = []
    for name, (a, b) in sets.items():
        pairs = [pair for pair in _pairs(a, b) if pair["told"]]
        apart = [pair["name"] for pair in pairs if not pair["agree"]]
        lines.append(
            {
                "set": name,
                "drive": a["drive"],
                "ratios": a["ratios"],
                "flights": [len(a["flights"]), len(b["flights"])],
                "seconds": a["seconds"] + b["seconds"],
                "told": len(pairs),
                "agree": len(pairs) - len(apart),
                "apart": apart,
                "processor_time": max(a["processor_time"], b["processor_time"]),
            }
        )
    return lines


def _pairs(a: Line, b: Line) -> list[Line]:
    others = {q["name"]: q for q in b["quantities"]}
    return [_pair(q, others[q["name"]]) for q in a["quantities"] if q["name"] in others]


def _pair(a: Line, b: Line) -> Line:
    """Return two values of a quantity, and whether they differ by less than their joint 95 %."""
    of: Callable[[float], float] = math.log if a["positive"] else float
    wide = [0.5 * (of(q["ci95"][1]) - of(q["ci95"][0])) for q in (a, b)]
    agree = abs(of(a["value"]) - of(b["value"])) <= math.hypot(*wide)
    return {"name": a["name"], "a": a, "b": b, "told": a["told"] and b["told"], "agree": agree}


def held_out_lines(sets: Halves) -> list[Line]:
    """Return a line a set and model: RMS of force and torque, medians of the open-loop errors, over
    both halves.

    Args: sets: results of `HalfCase`.
    """
    lines = []
    for name, two in sets.items():
        for model in MODELS:
            own = [row for half in two for row in half["held_out"] if row["model"] == model]
            line: Line = {"set": name, "model": model, "flights": len(own)}
            line |= {
                key: float(np.sqrt(np.mean([row[key] ** 2 for row in own])))
                for key in ("force", "torque")
            }
            for horizon in HORIZONS:
                errors = [row["open_loop"][f"{horizon:g}"] for row in own]
                known = [[np.nan if e is None else e for e in row] for row in errors]
                line[f"{horizon:g}"] = [
                    float(np.median(c)) if len(c := _known(k)) else None
                    for k in zip(*known, strict=True)
                ]
            lines.append(line)
    return lines


def _known(values: Sequence[float]) -> list[float]:
    return [v for v in values if v == v]


def printed(sets: Halves) -> list[Table]:
    """Return the tables of agreement, of single quantities and of held-out errors.

    Args: sets: results of `HalfCase`.
    """

    def one(name: str) -> Callable[[Line], str]:
        return lambda line: line.get(name, NOTHING)

    agreement = tabulate(
        "two halves of the flights: told quantities that differ by less than their joint 95 %",
        agreement_lines(sets),
        [
            ("set", "set"),
            ("input", "drive"),
            ("flights", lambda line: " + ".join(map(str, line["flights"]))),
            ("length [s]", lambda line: f"{line['seconds']:.0f}"),
            ("agree", lambda line: f"{line['agree']} of {line['told']}"),
            ("differ", lambda line: ", ".join(line["apart"]) or NOTHING),
            ("processor time [s]", lambda line: f"{line['processor_time']:.1f}"),
        ],
    )
    named = [
        {
            "set": name,
            "half": "AB"[i],
            **{pair["name"]: _value(pair, "ab"[i]) for pair in _pairs(*two)},
        }
        for name, two in sets.items()
        for i in range(2)
    ]
    shown = [name for name in NAMED if any(name in line for line in named)]
    values = tabulate(
        "single quantities of either half, with 95 %; per kg where the mass is not stated; "
        "in brackets: not told; "
        "starred: the halves differ",
        named,
        [("set", "set"), ("half", "half"), *((name, one(name)) for name in shown)],
    )
    errors = tabulate(
        "on the half that was not fitted: RMS of force over weight and torque over weight "
        "times arm; "
        "medians of open-loop prediction",
        held_out_lines(sets),
        [
            ("set", "set"),
            ("model", "model"),
            ("force [%]", lambda line: f"{100 * line['force']:.2f}"),
            ("torque [%]", lambda line: f"{100 * line['torque']:.2f}"),
            *(
                (f"{h:g} s: {what} [{unit}]", _error(f"{h:g}", place, factor))
                for h in HORIZONS
                for what, place, unit, factor in (
                    ("position", 0, "cm", 100.0),
                    ("attitude", 2, "deg", 180 / np.pi),
                )
            ),
        ],
    )
    return [agreement, values, errors]


def _error(horizon: str, place: int, factor: float) -> Callable[[Line], str]:
    return lambda line: (
        NOTHING if line[horizon][place] is None else f"{factor * line[horizon][place]:.2g}"
    )


def _value(pair: Line, half: str) -> str:
    q = pair[half]
    low, high = q["ci95"]
    if q["unit"] == "s":
        text = f"{1e3 * q['value']:.1f} ± {500 * (high - low):.1f} ms"
    elif q["positive"]:
        text = f"{q['value']:.3g} ± {100 * (math.sqrt(high / low) - 1):.2g} %"
    else:
        text = f"{q['value']:.3g} ± {0.5 * (high - low):.2g}"
    if not q["told"]:
        return f"({text})"
    return text if pair["agree"] else f"{text} *"
