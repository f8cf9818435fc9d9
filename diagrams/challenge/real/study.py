"""Study `real`: the diagnosis on real flights whose cause is known."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from diagrams.batch.failed_run import FailedRun
from diagrams.batch.options import RealFlightOptions
from diagrams.batch.run import Report, Run
from diagrams.batch.workers import failures
from diagrams.challenge.real.cases import RULE, OfNamedCase, make_cases
from diagrams.challenge.real.flights import require_logs
from diagrams.challenge.real.score import score_case
from diagrams.challenge.real.summary import NAMING, judged_names
from diagrams.challenge.real.tables import tables
from diagrams.challenge.score.binomial_intervals import binned
from np_drake.files.figure_file import DASHES, PALETTE, new_figure

EDGES = (0.0, 0.3, 0.5, 0.7, 0.9, 0.97, 1.0001)  # of the bins of probability [1]
MARKERS = ("o", "s", "^", "D")
ASIDE = 0.008  # by which series stand beside each other [1]


def bins(pairs: Sequence[tuple[float, bool]]) -> list[dict[str, Any]]:
    """Return, by bin of probability, mean probability, share true with its 95 % interval, and count."""
    p = np.array([pair[0] for pair in pairs], float)
    true = np.array([pair[1] for pair in pairs], float)
    place = np.clip(np.searchsorted(EDGES, p, side="right") - 1, 0, len(EDGES) - 2)
    return binned(true, place, EDGES, mean=(np.mean, p)) if len(p) else []


def calibration_figure(series: Mapping[str, Sequence[tuple[float, bool]]]) -> Figure:
    """Return reported probability against share true, by series, with 95 % intervals and counts."""
    figure, axes = new_figure(2, 1, width=5.2, height=5.6, sharex=True, height_ratios=(4, 1.3))
    ax, counts = axes[:, 0]
    ax.plot([0, 1], [0, 1], color="0.6", linewidth=1, label="as reported")
    shown = {name: bins(pairs) for name, pairs in series.items() if pairs}
    for i, (name, rows) in enumerate(shown.items()):
        x = np.array([row["mean"] for row in rows]) + ASIDE * (i - (len(shown) - 1) / 2)
        y = np.array([row["rate"] for row in rows])
        bounds = np.array([row["ci95"] for row in rows]).T
        total = sum(row["n"] for row in rows)
        style = {"color": PALETTE[i], "marker": MARKERS[i % len(MARKERS)], "linestyle": DASHES[i]}
        error = np.maximum([y - bounds[0], bounds[1] - y], 0.0)
        ax.errorbar(x, y, error, capsize=3, markersize=5, linewidth=1, label=f"{name} (n = {total})", **style)
        counts.plot(x, [row["n"] for row in rows], linewidth=1, markersize=4, **style)
    ax.set(xlim=(-0.02, 1.03), ylim=(-0.04, 1.04), ylabel="share that is true, 95 % interval [1]")
    ax.grid(color="0.92", linewidth=0.5)
    ax.set_axisbelow(True)
    counts.set(xlabel="reported probability of a name [1]", ylabel="names in the bin", yscale="log")
    counts.grid(color="0.92", linewidth=0.5)
    figure.legend(loc="outside lower center", ncols=2, fontsize=8)
    return figure


Options = RealFlightOptions


def run(run: Run, options: Options) -> Report:
    """The diagnosis on real flights with known causes, beside least squares.

    Args:
        run: seed, folders, workers and progress.
        options: of the study.
    """
    folder = options.given("real")
    cases = make_cases(folder, options.neurobem, options.only or ())
    require_logs(run, cases)
    config: dict[str, Any] = {"folder": folder, "neurobem": options.neurobem, "only": options.only}
    scoring = OfNamedCase(score_case, folder.resolve(), options.neurobem and options.neurobem.resolve())
    settings = {"folder": folder.name, "neurobem": options.neurobem and options.neurobem.name}
    named = [{"group": case.group, "name": case.name} for case in cases]
    finished = run.cases("diagnosing", "cases", scoring, named, config=settings)
    failed, records = failures(finished), [r["result"] for r in finished if "result" in r]
    series = {f"real flights, {method}": judged_names(records, method) for method in NAMING}
    failure = FailedRun(f"{failed[0]} ({len(failed)} of {len(cases)} cases failed)") if failed else None
    return Report(
        tables(records),
        config={**config, "cases": [f"{case.group}: {case.name}" for case in cases]},
        metrics={"table": records, "calibration": {n: bins(p) for n, p in series.items()}, "failures": failed},
        summary=[f"{len(records)} cases, by this rule:", *RULE],
        figures={"calibration.png": lambda: calibration_figure(series)} if any(series.values()) else {},
        failure=failure,
    )
