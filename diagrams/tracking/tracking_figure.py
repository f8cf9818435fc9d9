"""Plane tracks of the tracking comparison, one panel a track."""

import numpy as np
from matplotlib.figure import Figure

from diagrams.tracking.tracking import TRACKS
from np_drake.files.figure_file import DASHES, PALETTE, new_figure


def plane_tracks(laps: dict[tuple[str, str], dict[str, np.ndarray]], title: str = "") -> Figure:
    """Plot the last lap of each row, the reference dotted.

    An error along the track does not show here; the table has it.

    Args:
        laps: (track, row): x_true, p_ref (n, 2) [m].
    """
    figure, axes = new_figure(1, len(TRACKS), width=10.0, height=4.6)
    rows = list(dict.fromkeys(row for _, row in laps))
    for ax, track in zip(axes[0], TRACKS, strict=True):
        ref = next((lap["p_ref"] for (on, _), lap in laps.items() if on == track), np.zeros((0, 2)))
        ax.plot(ref[:, 0], ref[:, 1], color="0.3", linestyle=":", linewidth=1.5, label="reference")
        for k, row in enumerate(rows):
            p = laps.get((track, row), {}).get("x_true", np.zeros((0, 2)))
            ax.plot(*p.T, color=PALETTE[k], linestyle=DASHES[k], linewidth=1.2, label=row)
        ax.set(xlabel="x [m]", ylabel="y [m]", title=track, aspect="equal")
        ax.grid(alpha=0.3)
    figure.suptitle(title, fontsize=9)
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=8
    )
    return figure
