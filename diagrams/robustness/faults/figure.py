"""Figure of the campaign with faults: losses and times to recover, a line a kind of fault."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from diagrams.robustness.faults.campaign import DURATION, RAMP
from diagrams.robustness.faults.kinds import FIRST
from diagrams.robustness.faults.measures import BACK
from diagrams.robustness.faults.table import OURS, PHYSICS
from np_drake.files.figure_file import PALETTE, new_figure

_EDGE = RAMP + DURATION - FIRST[0]  # longest time after an onset [s]
SHADES = {PHYSICS: ("0.6", "", "the oracle loses it too"), OURS: (PALETTE[1], "////", "the oracle survives")}


def faults_figure(lines: Sequence[dict], title: str = "") -> Figure:
    """Plot the share of lost vehicles and the time to recover of every kind of fault.

    Args: lines: of `by_fault`.
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
    ax.barh(
        places, width, left=left, color=colour, hatch=hatch, edgecolor="white", label=label, linewidth=0.0
    )


def _range(ax, place: int, line: dict) -> None:
    """Draw median and 90 % quantile of the time to recover."""
    if line["recovery"] is None:
        return
    end = _EDGE if line["recovery_90"] is None else line["recovery_90"]
    ax.plot([line["recovery"], end], [place, place], "-", color=PALETTE[0], linewidth=1.2)
    ax.plot(line["recovery"], place, "o", color=PALETTE[0], markersize=4)
    if line["recovery_90"] is None:
        ax.plot(end, place, ">", color=PALETTE[0], markersize=5)
