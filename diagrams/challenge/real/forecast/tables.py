"""Tables of the forecasts on payload flights."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from diagrams.batch.run import Table
from diagrams.challenge.real.forecast.rows import PERSISTENCE, TOLD_ROWS
from diagrams.challenge.real.forecast.scores import KINDS
from diagrams.challenge.real.forecast.study import FlownPayload
from np_drake.payload_filter.filter_bank import Estimate, PayloadEstimate
from np_drake.skill.skill import MOTIONS

# Ratio of the lateral force that is asked for, by horizon [s].
ASKED = {0.1: 0.50, 0.2: 0.42, 0.4: 0.45, 0.8: 0.48}
ASKED_KIND = "lateral force"
MARK = "*"  # behind rows that are told the truth


def ratio_tables(lines: Sequence[Mapping[str, Any]]) -> list[Table]:
    """Return a table for each coming motion and kind: rows against horizons, ratio and half its 95
    % interval.
    """
    return [
        _ratios(
            [line for line in lines if (line["motion"], line["kind"]) == (motion, kind)],
            motion,
            kind,
        )
        for motion in dict.fromkeys(line["motion"] for line in lines)
        for kind in KINDS
    ]


def _ratios(lines: Sequence[Mapping[str, Any]], motion: str, kind: str) -> Table:
    horizons = list(dict.fromkeys(line["horizon"] for line in lines))
    rows: list[tuple] = []
    for name in dict.fromkeys(line["row"] for line in lines):
        cells = {line["horizon"]: _cell(line) for line in lines if line["row"] == name}
        rows.append((marked(name), *(cells[h] for h in horizons)))
    if kind == ASKED_KIND:
        wanted = [
            next((r for at, r in ASKED.items() if abs(at - h) < 1e-6), None) for h in horizons
        ]
        rows.append(("asked", *("" if r is None else f"{r:.2f}" for r in wanted)))
    title = (
        f"{kind}: RMSE over that of persistence (± half of the 95 % interval), coming "
        f"motion {motion}"
    )
    return title, ["ahead", *(f"{h:.3g} s" for h in horizons)], rows


def marked(name: str) -> str:
    """Return the name of a row, with a mark where it is told the truth."""
    return name + MARK if name in TOLD_ROWS else name


def _cell(line: Mapping[str, Any]) -> str:
    ratio, half = line["ratio"], 0.5 * (line["interval"][1] - line["interval"][0])
    if not np.isfinite(ratio):
        return "diverges"
    if ratio >= 100:
        return f"{ratio:.1e}"
    digits = 2 if ratio < 10 else 1
    return f"{ratio:.{digits}f}" + (f"±{half:.{digits}f}" if half < 10 else "")


def divergence_table(models: Sequence[Mapping[str, Any]]) -> Table:
    """Return a table of each row's divergent flights, by coming motion.

    Args: models: of `Study.models`.
    """
    rows = [
        (
            marked(model["row"]),
            *(f"{len(lost)} of {model['flights']}" for lost in model["diverged"].values()),
        )
        for model in models
    ]
    return "divergent flights", ["row", "diverge, known", "held"], rows


def payload_table(
    payloads: Sequence[FlownPayload], true: PayloadEstimate, damping: tuple[float, float]
) -> Table:
    """Return a table of the payload as estimated at the end of the flights, manoeuvre by manoeuvre.

    Mean over flights of the posterior mean, and of the ends of its 95 % interval; below, mean and
    range over all flights, and in how many the interval holds the truth (of damping: meets its
    range).

    Args:
        true: length, mass share and damping, of which the means count.
        damping: range of the true one [1/s].
    """
    rows: list[tuple] = []
    for manoeuvre in dict.fromkeys(flown.manoeuvre for flown in payloads):
        estimates = [flown.estimate for flown in payloads if flown.manoeuvre == manoeuvre]
        cells = [
            _interval([getattr(e, name) for e in estimates]) for name in PayloadEstimate._fields
        ]
        rows.append((manoeuvre, *cells))
    means = [
        [getattr(flown.estimate, name).mean for flown in payloads]
        for name in PayloadEstimate._fields
    ]
    rows.append(("mean (range)", *(_range(values) for values in means)))
    ends = ((true.length.mean,) * 2, (true.mass.mean,) * 2, damping)
    held = [
        sum(e.low <= high and low <= e.high for e in (getattr(f.estimate, name) for f in payloads))
        for name, (low, high) in zip(PayloadEstimate._fields, ends, strict=True)
    ]
    rows.append(("interval holds the truth", *(f"{count} of {len(payloads)}" for count in held)))
    shown = (
        f"{true.length.mean:.3f}",
        f"{true.mass.mean:.3f}",
        f"{damping[0]:.2f}–{damping[1]:.2f}",
    )
    rows.append(("truth", *shown))
    title = (
        "payload as pendulum estimates it by the end of a flight: posterior mean [95 % interval]"
    )
    return title, ["manoeuvre", "tether [m]", "mass over vehicle's [1]", "damping [1/s]"], rows


def _interval(estimates: Sequence[Estimate]) -> str:
    mean, low, high = np.mean(estimates, axis=0)
    return f"{mean:.3f} [{low:.3f}, {high:.3f}]"


def _range(values: Sequence[float]) -> str:
    return f"{np.mean(values):.3g} ({min(values):.3g}–{max(values):.3g})"


def persistence_rmse(lines: Sequence[Mapping[str, Any]]) -> dict[str, list[float]]:
    """Return the RMSE of persistence by kind, over the horizons [N, N·m]."""
    own = [line for line in lines if line["row"] == PERSISTENCE and line["motion"] == MOTIONS[0]]
    return {kind: [float(line["rmse"]) for line in own if line["kind"] == kind] for kind in KINDS}
