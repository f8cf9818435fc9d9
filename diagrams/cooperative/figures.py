"""Plots of a fleet and its payload, from above and from the side; returns a Figure and shows nothing."""

from matplotlib.figure import Figure

from diagrams.cooperative.result import CooperativeResult
from np_drake.files.figure_file import DASHES, PALETTE, new_figure


def paths(flight: CooperativeResult, title: str = "") -> Figure:
    """Plot the top (x, y) and side (x, z) view of the scored part.

    Cables are shown at three instants, references dotted in grey.
    """
    config, s = flight.config, flight.signals
    rows = flight.rows("all")
    instants = [config.settle, config.start + config.transport / 2, config.end - 2 * config.controller.period]
    moments = [int((s["t"] <= t + 1e-9).sum()) - 1 for t in instants]
    figure, axes = new_figure(2, 1, width=7.0, height=6.5, sharex=True)
    for ax, (vertical, name) in zip(axes[:, 0], ((1, "y"), (2, "z")), strict=True):
        for i in range(config.vehicles):
            p, p_ref = flight.p[i], s[f"p_ref_{i}"]
            ax.plot(
                p_ref[rows, 0], p_ref[rows, vertical], color="0.5", linestyle=":", linewidth=2.5, zorder=1
            )
            style = {"color": PALETTE[i % 6], "linestyle": DASHES[i % 6], "linewidth": 1.4}
            ax.plot(p[rows, 0], p[rows, vertical], label=f"vehicle {i}", **style)
            for k in moments:
                ends = [p[k], flight.payload[k]]
                ax.plot(
                    [e[0] for e in ends], [e[vertical] for e in ends], color="0.6", linewidth=0.8, zorder=0
                )
                ax.plot(*p[k, [0, vertical]], marker="x", color=style["color"], markersize=7)
        bob, bob_ref = flight.payload, flight.payload_ref
        ax.plot(
            bob_ref[rows, 0], bob_ref[rows, vertical], color="0.5", linestyle=":", linewidth=2.5, zorder=1
        )
        ax.plot(bob[rows, 0], bob[rows, vertical], color=PALETTE[6], linewidth=1.6, label="payload")
        ax.plot(bob[moments, 0], bob[moments, vertical], "o", color=PALETTE[6], markersize=6)
        ax.set(ylabel=f"{name} [m]", aspect="equal")
        ax.grid(alpha=0.3)
    axes[0, 0].set_title(title, fontsize=10)
    axes[1, 0].set_xlabel("x [m]  (dotted: reference; grey lines: cables)")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=8)
    return figure
