"""Study `faults`: flights with random faults under every controller."""

import dataclasses as dc
from collections.abc import Sequence
from typing import Annotated

from matplotlib.figure import Figure
from typer import Option

from diagrams.batch.campaign import Record
from diagrams.batch.columns import Column, tabulate
from diagrams.batch.flown import FlownOptions, choose_rows
from diagrams.batch.run import Report, Run, Table
from diagrams.batch.workers import require_result
from diagrams.robustness.faults import campaign as experiment
from diagrams.robustness.faults.campaign import BACK, DURATION, RAMP
from diagrams.robustness.faults.kinds import FIRST
from diagrams.robustness.faults.table import OURS, PHYSICS, by_controller, by_fault, loss_cells, ours_to_mend, verdicts
from diagrams.robustness.robustness import sweep_of
from np_drake.files.figure_file import PALETTE, new_figure
from np_drake.files.number_text import NOTHING

Flights = Annotated[int, Option("--flights", min=1, max=100_000, help="Flights, of seeds seed + 1, …")]
SHORT = {"payload_filter": "filter"}  # names of rows that would make the table too wide
_EDGE = RAMP + DURATION - FIRST[0]  # longest time after an onset [s]
SHADES = {PHYSICS: ("0.6", "", "the oracle loses it too"), OURS: (PALETTE[1], "////", "the oracle survives")}
_COUNTS: tuple[Column, ...] = (
    ("flights", "flights"),
    ("errors", "exceptions"),
    ("NaN", "nan"),
    ("lost", "lost"),
    ("physics", "physics"),
    ("ours", "ours"),
    ("not back", "away"),
    ("back [s]", lambda line: _time(line["recovery"])),
    ("90 % [s]", lambda line: _time(line["recovery_90"])),
)


@dc.dataclass(frozen=True)
class Options(FlownOptions):
    """Options of the study."""

    seeds: Flights = 1000
    only: Annotated[list[str] | None, Option("--only", help="Only rows of these names.")] = None


def run(run: Run, options: Options) -> Report:
    """Random faults of sensors, solver, rotors, payload, air. --out DIR: figure, and cases to resume from.

    Args:
        run: seed, folders, workers and progress.
        options: of the study.
    """
    run = sweep_of(run, options, DURATION)
    rows = choose_rows(experiment.ROWS, options.only, always=())
    trainings, flights, beside = experiment.run_faults(run, rows)
    require_result(flights)
    verdict = verdicts(flights, beside)
    lines, kinds, cells = by_controller(flights, verdict), by_fault(flights, verdict), loss_cells(flights)
    title = f"{run.count} flights, seeds {run.seeds[0]} … {run.seeds[-1]}, {run.solver}"
    config = experiment.campaign_config(run.seed, run.solver) | {"seeds": run.seeds}
    named = ours_to_mend(flights, verdict)
    return Report(
        [
            tabulate(f"controllers; {title}", lines, (("controller", "row"), *_COUNTS)),
            tabulate("faults, all controllers but the oracle", kinds, (("fault", "fault"), *_COUNTS)),
            _losses(cells, rows),
        ],
        config=config,
        metrics={
            "table": lines,
            "faults": kinds,
            "losses": cells,
            "ours": named,
            "runs": [*trainings, *flights, *beside],
        },
        summary=[f"ours to mend: {line}" for line in named],
        notes=[
            *_failures([*trainings, *flights, *beside]),
            *(f"{name}: {value}" for name, value in config.items() if name != "seeds"),
        ],
        figures={"faults.png": lambda: faults_figure(kinds, title)},
    )


def _failures(records: list[Record]) -> list[str]:
    """Return a line on every case that ended with an exception or whose integrator gave up."""
    said = [f"exception: {r['case']}: {r['error']}" for r in records if "error" in r]
    ended = [r for r in records if "result" in r and r["result"].get("gave_up")]
    return [*said, *(f"exception: {r['case']}: {r['result']['lost']}" for r in ended)]


def _time(value: float | None) -> str:
    return NOTHING if value is None else f"{value:.2f}"


def _losses(lines: list[dict], rows: tuple) -> Table:
    """Return the table of lost of flown vehicles by kind of fault and controller."""

    def cell(name: str):
        return lambda line: f"{line['cells'][name][0]}/{line['cells'][name][1]}"

    columns: list[Column] = [("fault", "fault")]
    columns += [(SHORT.get(row.name, row.name), cell(row.name)) for row in rows]
    return tabulate("lost of flown, by fault and controller", lines, columns)


def faults_figure(lines: Sequence[dict], title: str = "") -> Figure:
    """Plot the share of lost vehicles and the time to recover of every kind of fault.

    Args:
        lines: of `by_fault`.
        title: above both panels.
    """
    figure, axes = new_figure(1, 2, width=7.5, height=1.6 + 0.25 * len(lines), sharey=True)
    losses, times = axes[0]
    places = list(range(len(lines)))[::-1]
    for mark, start in ((PHYSICS, None), (OURS, PHYSICS)):
        _bars(losses, places, lines, mark, start)
    for place, line in zip(places, lines, strict=True):
        total = f"{line['lost']} of {line['flights']}"
        losses.text(100 * _share(line, "lost") + 1.5, place, total, va="center", fontsize=7)
        _range(times, place, line)
    losses.set_yticks(places, [line["fault"] for line in lines], fontsize=8)
    losses.set_xlim(0, 115)
    losses.set_xticks((0, 25, 50, 75, 100))
    losses.set_xlabel("lost vehicles [%]")
    times.set_xlabel(f"time to recover to {100 * BACK:g} cm [s]")
    times.set_xlim(-0.1, 1.05 * _EDGE)
    times.plot([], [], "o-", color=PALETTE[0], markersize=4, label="median to 90 %")
    times.plot([], [], ">", color=PALETTE[0], markersize=5, label="90 % not back by the end")
    for ax in (losses, times):
        ax.grid(axis="x", alpha=0.3, linewidth=0.4)
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2, fontsize=7, frameon=False)
    figure.suptitle(title, fontsize=9)
    return figure


def _share(line: dict, key: str) -> float:
    return line[key] / line["flights"] if line["flights"] else 0.0


def _bars(ax, places: list[int], lines: Sequence[dict], mark: str, start: str | None) -> None:
    """Draw the part of the losses with this verdict, behind that of `start`."""
    colour, hatch, label = SHADES[mark]
    left = [100 * _share(line, start) if start else 0.0 for line in lines]
    width = [100 * _share(line, mark) for line in lines]
    ax.barh(places, width, left=left, color=colour, hatch=hatch, edgecolor="white", label=label, linewidth=0.0)


def _range(ax, place: int, line: dict) -> None:
    """Draw median and 90 % quantile of the time to recover."""
    if line["recovery"] is None:
        return
    end = _EDGE if line["recovery_90"] is None else line["recovery_90"]
    ax.plot([line["recovery"], end], [place, place], "-", color=PALETTE[0], linewidth=1.2)
    ax.plot(line["recovery"], place, "o", color=PALETTE[0], markersize=4)
    if line["recovery_90"] is None:
        ax.plot(end, place, ">", color=PALETTE[0], markersize=5)
