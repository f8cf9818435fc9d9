"""Figure of active diagnosis: entropy over the explanations, and the right one alone, against flight time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from diagrams.challenge.active.tables import Result, answer_after, left_open
from np_drake.files.figure_file import DASHES, PALETTE, new_figure

MARKERS = "osD^vP"
APART = 0.35  # of the arms, so that their bars do not hide each other [s]


def active_figure(
    results: Sequence[Result], arms: Sequence[str], *, flights: int, begun: float, seconds: float
) -> Figure:
    """Return the figure over the cases that the first flights leave open.

    Args:
        arms: that are drawn.
        flights: most further flights.
        begun, seconds: length of the first flights together, and of a further one [s].
    """
    figure, axes = new_figure(1, 2, width=9.5, height=4.0)
    still, t = left_open(results), begun + seconds * np.arange(flights + 1)
    for i, arm in enumerate(arms):
        style = {"color": PALETTE[i], "linestyle": DASHES[i], "marker": MARKERS[i], "markersize": 4.5}
        at = t + APART * (i - 0.5 * (len(arms) - 1))
        _entropy(axes[0, 0], at, [_entropies(still, arm, k) for k in range(flights + 1)], arm, style)
        share = [
            100 * np.mean([answer_after(r, arm, k)["right_alone"] for r in still]) for k in range(flights + 1)
        ]
        axes[0, 1].plot(at, share, label=arm, **style)
    axes[0, 0].set(
        ylabel="entropy over the explanations [nat]", title=f"median and quartiles, {len(still)} cases"
    )
    axes[0, 1].set(
        ylabel="the right explanation stands alone [%]", title="share of the cases", ylim=(-3, 103)
    )
    for ax in axes[0]:
        ax.set_xlabel("flight time [s]")
        ax.set_xticks(t)
        ax.grid(color="0.9", linewidth=0.5)
    figure.legend(*axes[0, 1].get_legend_handles_labels(), loc="outside right center", fontsize=8)
    return figure


def _entropies(results: Sequence[Result], arm: str, flights: int) -> list[float]:
    """Return the entropies after further flights [nat], without cases whose logs told no explanation."""
    found = [answer_after(r, arm, flights)["entropy"] for r in results]
    return [value for value in found if value is not None]


def _entropy(ax: Axes, t: np.ndarray, values: Sequence[Sequence[float]], arm: str, style: dict) -> None:
    """Draw medians and, as bars, quartiles."""
    quarters = np.array([np.percentile(v, [25, 50, 75]) if len(v) else [np.nan] * 3 for v in values])
    low, middle, high = quarters.T
    ax.errorbar(t, middle, [middle - low, high - middle], label=arm, capsize=2, elinewidth=0.8, **style)
