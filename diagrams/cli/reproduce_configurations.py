"""The table of `np-drake reproduce configurations`."""

import dataclasses as dc
import tempfile
from pathlib import Path

from diagrams.cli.output import make_folder, progress, write_metrics
from diagrams.cli.reproduce_flights import Table


def configurations_table(
    *, seeds: int, solver: str, jobs: int, only: list[str], seed: int, out: Path | None, json: Path | None
) -> tuple[Table, list[str]]:
    """Every configuration in the loop beside nominal, hold and oracle; and the lines that stand under the table.

    Args: only: rows that fly; all where empty.   out: folder that keeps the model files.   json: metrics file.
    Raises: ValueError: on an unknown row.
    """
    from diagrams import configurations, tracking
    from np_drake.lifting.training import make_config

    rows = choose_rows(configurations.ROWS, only)
    evaluation = [seed + 1 + k for k in range(seeds)]
    with tempfile.TemporaryDirectory() as scratch, progress("configurations", 1.0) as advance:
        summaries = tracking.run_tracking(
            make_folder(out) if out else Path(scratch),
            seeds=evaluation,
            training_seed=seed,
            solver=solver,
            rows=rows,
            jobs=jobs,
            on_progress=lambda done, total: advance(done / total, f"{done} of {total} flights"),
        )
    lines, places = tracking.table(summaries, rows), configurations.ranking(summaries)
    used = {row.configuration: make_config(row.configuration, seed=seed) for row in rows if row.configuration}
    weights = tracking.frozen_weights()
    config = {"solver": solver, "seeds": evaluation, "training_seed": seed, "mpc": weights}
    config["configurations"] = {name: dc.asdict(c) for name, c in used.items()}
    best = [{"row": name, "mean": mean, "sd": sd} for name, mean, sd in places]
    write_metrics(json, "reproduce", seed=seed, config=config, table=lines, ranking=best, runs=summaries)
    title = (
        f"{seeds} flights a row, seeds {evaluation[0]} … {evaluation[-1]}, trained on seed {seed}, {solver}; "
        "± standard deviation over seeds"
    )
    notes = [
        configurations.verdict(places),
        f"training: {configurations.TRAINING}, seed {seed}; evaluation: seeds {evaluation}",
        *(f"{name}: {c}" for name, c in used.items()),
    ]
    return printed(lines, title), notes


def choose_rows(rows: tuple, only: list[str]) -> tuple:
    """The rows of these names, all where there are none; nominal always. Raises ValueError on an unknown name."""
    unknown = set(only) - {row.name for row in rows}
    if unknown:
        names = "; ".join(row.name for row in rows)
        raise ValueError(f"--only: must name rows of the table ({names}); got {', '.join(sorted(unknown))}.")
    return tuple(row for row in rows if not only or row.name in only or row.name == "nominal")


def printed(lines: list[dict], title: str) -> Table:
    """Title, header and rows of the lines that `tracking.table` gives; errors in cm."""

    def cell(line: dict, key: str) -> str:
        if line[key] == float("inf"):
            return "lost"
        sd = line[f"{key}_sd"]
        return f"{100 * line[key]:.2f}" + (f" ± {100 * sd:.2f}" if sd == sd else "")

    header = ["track", "controller", "E_xy [cm]", "E_z [cm]", "growth", "failed"]
    rows: list[tuple] = [
        (
            *(line["track"], line["row"], cell(line, "E_xy"), cell(line, "E_z")),
            *(f"{line['growth']:.2f}", line["solve_failures"]),
        )
        for line in sorted(lines, key=lambda line: line["track"])
    ]
    return title, header, rows
