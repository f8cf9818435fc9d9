"""The report's folder: HTML page, JSON and figures, all made before anything is written."""

import itertools
from collections.abc import Collection, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from np_drake.diagnosis.report import words
from np_drake.diagnosis.result import Diagnosis, Regime, ReplayGap
from np_drake.files.figure_file import PALETTE, Figure, new_figure
from np_drake.files.file_access import require_writable, write_json
from np_drake.files.page import Section, write_page
from np_drake.vehicle import Vehicle
from np_drake.vehicle.rotor_layout import RotorName

BEFORE = PALETTE[1]
AFTER = PALETTE[0]
NOISE = "0.25"
PLAIN_TICKS = "{x:g}"  # 0.01, 0.1, 1 instead of powers of ten
# in every legend
NOMINAL = "nominal simulator"
WITH = "with the causes"


def legend(figure: Figure) -> None:
    """Add one legend above all panels, with every label once."""
    shown = {
        label: handle
        for ax in figure.get_axes()
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        list(shown.values()),
        list(shown),
        loc="outside upper center",
        ncols=max(len(shown), 1),
        frameon=False,
    )


def replay_figure(before: ReplayGap | None, after: ReplayGap | None) -> Figure:
    """Return the median replay error against horizon on logarithmic axes, with 95 % intervals.

    One panel each shows position, velocity and attitude.
    """
    figure, grid = new_figure(1, 3, width=9.0, height=3.1)
    panels = (
        ("position", "position [m]"),
        ("velocity", "velocity [m/s]"),
        ("attitude", "attitude [deg]"),
    )
    curves = ((before, NOMINAL, BEFORE, "o", "--"), (after, WITH, AFTER, "s", "-"))
    for ax, (name, axis) in zip(grid[0], panels, strict=True):
        ax.set(xscale="log", yscale="log", xlabel="horizon [s]", ylabel=f"error of {axis}")
        for gap, label, colour, marker, dash in curves:
            if gap is None:
                continue
            values = np.asarray(getattr(gap, name), float)
            values = np.where(np.isfinite(values) & (values > 0), values, np.nan)
            ax.fill_between(
                gap.horizon, values[:, 1], values[:, 2], color=colour, alpha=0.22, linewidth=0
            )
            ax.plot(
                gap.horizon, values[:, 0], color=colour, marker=marker, linestyle=dash, label=label
            )
            ax.set_xticks(gap.horizon, [f"{h:g}" for h in gap.horizon])
            ax.set_xticks([], minor=True)
        ax.yaxis.set_major_formatter(PLAIN_TICKS)
        ax.grid(alpha=0.3, linewidth=0.6)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
    legend(figure)
    return figure


def regime_figure(regimes: Sequence[Regime]) -> Figure:
    """Return the residual over noise against each quantity, before and after: largest channel."""
    names = list(dict.fromkeys(regime.quantity for regime in regimes))
    figure, grid = new_figure(1, len(names), width=9.0, height=2.6, sharey=True)
    curves = (("rms", NOMINAL, BEFORE, "--"), ("rms_after", WITH, AFTER, "-"))
    for ax, name in zip(grid[0], names, strict=True):
        group = [regime for regime in regimes if regime.quantity == name]
        edges = [group[0].lower, *(regime.upper for regime in group)]
        for field, label, colour, dash in curves:
            values = [max(getattr(regime, field)) for regime in group]
            ax.stairs(values, edges, color=colour, linestyle=dash, linewidth=1.6, label=label)
        ax.axhline(1.0, color=NOISE, linestyle=":", linewidth=1.0, label="noise")
        ax.set(xlabel=f"{name} [{group[0].unit}]", yscale="log")
    grid[0, 0].set_ylabel("RMS residual over noise [1]")
    legend(figure)
    return figure


def rotor_figure(vehicle: Vehicle, rotors: Sequence[RotorName], marked: Collection[int]) -> Figure:
    """Return the vehicle from above, front up: numbers of the vehicle file, how rotors turn, names.

    Args:
        marked: numbers of the rotors that stand out.
    """
    from matplotlib.patches import Circle

    # Front is up and left is left.
    p = vehicle.rotor_positions_B[:, :2] @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    figure, grid = new_figure(1, 1, width=4.2, height=3.6)
    ax = grid[0, 0]
    span = np.abs(p).max()
    radius = 0.36 * float(min(np.linalg.norm(a - b) for a, b in itertools.combinations(p, 2)))
    for rotor, centre, turn in zip(rotors, p, vehicle.rotor_directions, strict=True):
        stands_out = rotor.number in marked
        ax.plot(*np.transpose([[0.0, 0.0], centre]), color="0.6", linewidth=3.0, zorder=1)
        # Not by colour alone.
        edge = {"hatch": "///", "edgecolor": BEFORE} if stands_out else {"edgecolor": "0.4"}
        ax.add_patch(Circle(centre, radius, facecolor="white", linewidth=2.0, zorder=2, **edge))
        start, end = (centre + 0.72 * radius * np.array([side, 0.35]) for side in (-turn, turn))
        ax.annotate(
            "",
            end,
            start,
            arrowprops={**ARROW, "connectionstyle": f"arc3,rad={-0.5 * turn}"},
            zorder=3,
        )
        name = {"ha": "center", "va": "center", "weight": "bold" if stands_out else "normal"}
        ax.text(*centre, str(rotor.number), fontsize=13, bbox=PLAIN_BOX, zorder=4, **name)
        ax.text(*(centre - [0.0, 1.25 * radius]), rotor.log or rotor.place, fontsize=9, **name)
    reach = span + 1.6 * radius
    ax.annotate("front", (0.0, 1.3 * reach), (0.0, reach), ha="center", arrowprops=ARROW)
    ax.set(xlim=(-reach, reach), ylim=(-reach, 1.3 * reach), aspect="equal")
    ax.set_axis_off()
    return figure


ARROW = {"arrowstyle": "-|>", "color": "0.25", "shrinkA": 0.0, "shrinkB": 0.0}
PLAIN_BOX = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
TEMPLATE = Path(__file__).with_name("report.html.j2")
PAGE = "report.html"
DATA = "diagnosis.json"


def content(diagnosis: Diagnosis, seed: int) -> dict[str, Any]:
    """Return all values that the template uses, with numbers formatted as text."""
    identifiability = diagnosis.identifiability
    reduction = diagnosis.gap_reduction
    replays = (reduction.replay_before, reduction.replay_after)
    return {
        **answer(diagnosis),
        "refit": None if diagnosis.refit is None else answer(diagnosis.refit),
        "new_on_held_out": [finding.text.rstrip(".") for finding in diagnosis.new_on_held_out],
        "calibrated": bool(diagnosis.calibration),
        "difference_header": words.DIFFERENCE_HEADER,
        "differences": words.difference_rows(diagnosis),
        "next_steps": words.next_steps(diagnosis),
        "replay": any(replays),
        "starts": next((gap.starts for gap in replays if gap), 0),
        "below_threshold": [
            (
                words.capital(words.bare_name(f.name)),
                f.text,
                words.percent(f.size) if abs(f.size) <= 1 else words.number(f.size, 2),
            )
            for f in diagnosis.below_threshold
        ],
        "usable": identifiability.usable,
        "excitation": [
            (name.partition(" [")[0], words.measure(value, name.partition(" [")[2][:-1] or "1"))
            for name, value in identifiability.excitation.items()
        ],
        "noise_floor": [
            (name, words.measure(value, "N" if name.startswith("force") else "N·m"))
            for name, value in identifiability.noise_floor.items()
        ],
        "doubts": diagnosis.doubts,
        "warnings": words.warnings(diagnosis),
        "flights": [
            *((name, "fit") for name in diagnosis.train),
            *((n, "judge") for n in diagnosis.held_out),
        ],
        "vehicle": diagnosis.vehicle,
        "facts": [
            ("vehicle", diagnosis.vehicle),
            ("judged as logs of a", diagnosis.judged_as or words.NOTHING),
            ("np_drake", version("np_drake")),
            ("seed", str(seed)),
            ("computed in", words.with_unit(words.number(diagnosis.wall, 2), "s")),
        ],
    }


def answer(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return headline, lead, tables and remainder of one answer; a report may hold two."""
    header, rows = words.cause_table(diagnosis)
    return {
        "headline": words.headline(diagnosis),
        "lead": words.lead(diagnosis),
        "cause_header": header,
        "causes": rows,
        "gap_header": words.GAP_HEADER,
        "gap": words.gap_rows(diagnosis),
        "remains": words.remains(diagnosis),
        "unexplained": [
            (words.capital(words.described(f)), f.measurement) for f in diagnosis.unexplained
        ],
        "cannot_tell": diagnosis.cannot_tell,
        "joined": diagnosis.joined,
    }


def write_report(
    diagnosis: Diagnosis,
    folder: str | Path,
    *,
    seed: int = 0,
    config: dict[str, Any] | None = None,
    links: Mapping[str, str] = MappingProxyType({}),
) -> Path:
    """Write `report.html`, `diagnosis.json` and the figures to a folder, and return the path of the
    page.

    Args:
        seed: seed of the diagnosis, for the head of the JSON.
        config: configuration of the diagnosis, for the head of the JSON.
        links: further files of the folder to which the page leads, with the text of each link.
    Raises: OSError: if the folder cannot be written.
    """
    folder = Path(folder)
    require_writable(folder / PAGE)
    title = f"Sim-to-real diagnosis · {diagnosis.vehicle}"
    section = Section(TEMPLATE, content(diagnosis, seed) | {"links": links})
    write_page(folder / PAGE, title, [section], figures(diagnosis))
    data = diagnosis.as_json()
    # The head that every file of the project begins with (docs/reference/files.md).
    write_json(
        folder / DATA,
        {
            "schema": data["schema"],
            "version": version("np_drake"),
            "seed": seed,
            "config": config or {},
            **data,
        },
    )
    return folder / PAGE


def figures(diagnosis: Diagnosis) -> dict[str, Figure | None]:
    """Return the figures by name; None where the diagnosis has no data for one."""
    regimes = diagnosis.localisation.regimes
    reduction = diagnosis.gap_reduction
    replays = (reduction.replay_before, reduction.replay_after)
    marked = [c.rotor.number for c in words.named_causes(diagnosis) if c.rotor]
    vehicle = diagnosis.nominal
    return {
        "rotors": rotor_figure(vehicle, diagnosis.rotors, marked) if vehicle and marked else None,
        "regimes": regime_figure(regimes) if regimes else None,
        "replay": replay_figure(*replays) if any(replays) else None,
    }
