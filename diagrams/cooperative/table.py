"""Table over fleets and controllers: means over the flights of a row, with intervals."""

from collections.abc import Sequence

import numpy as np

from diagrams.cooperative.result import PHASES
from np_drake.metrics import half_width


def cooperative_table(summaries: Sequence[dict]) -> list[dict]:
    """Return one line a fleet and row, from the summaries of `run_cooperative`.

    Per phase every metric and its `_ci95`, half width of the 95 % interval of the mean [m] (Student; NaN for one
    flight). solve_failures: of all flights; processor_time [s/s], solve_ms (median, p95): means; closest [m],
    tension [N]: extremes. flights: completed ones; lost: the reasons of the others, in that case no metrics at all.
    """
    lines = []
    for key in dict.fromkeys((line["vehicles"], line["row"]) for line in summaries):
        mine = [line for line in summaries if (line["vehicles"], line["row"]) == key]
        found = [line["metrics"] for line in mine if "metrics" in line]
        line: dict = {"vehicles": key[0], "row": key[1], "flights": len(found)}
        line["lost"] = [one["lost"] for one in mine if "lost" in one]
        lines.append(line if line["lost"] else line | _together(found))
    return lines


def _together(found: list[dict]) -> dict:
    """Return the means and extremes of flights that were all completed."""
    phases: dict = {}
    for phase in PHASES:
        values = {key: np.array([m[phase][key] for m in found]) for key in found[0][phase]}
        phases[phase] = {key: float(value.mean()) for key, value in values.items()}
        phases[phase] |= {f"{key}_ci95": half_width(value) for key, value in values.items()}
    solve = {key: float(np.mean([m["solve_ms"][key] for m in found])) for key in ("median", "p95")}
    tension = [m["tension"] for m in found]
    return {
        **phases,
        "solve_failures": int(sum(m["solve_failures"] for m in found)),
        "processor_time": float(np.mean([m["processor_time"] for m in found])),
        "solve_ms": solve,
        "closest": float(min(m["closest"] for m in found)),
        "tension": {
            "min": float(min(t["min"] for t in tension)),
            "max": float(max(t["max"] for t in tension)),
        },
    }
