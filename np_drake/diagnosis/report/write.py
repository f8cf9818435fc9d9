"""Writing of the report's folder: page, JSON and figures, all made before anything is written."""

import math
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any

from matplotlib.figure import Figure

from np_drake.diagnosis.report.gap_figures import ladder_figure, replay_figure
from np_drake.diagnosis.report.localisation_figures import regime_figure, spectrum_figure, timeline_figure
from np_drake.diagnosis.report.page import render
from np_drake.diagnosis.result import Diagnosis, as_json
from np_drake.files.atomic_file import require_writable, write_bytes, write_json, write_text
from np_drake.files.figure_file import png

PAGE, DATA = "report.html", "diagnosis.json"
PICTURES = ("ladder", "regimes", "timeline", "spectrum", "replay")


def write_report(
    diagnosis: Diagnosis,
    folder: str | Path,
    *,
    seed: int = 0,
    config: dict[str, Any] | None = None,
    beside: Mapping[str, str] = MappingProxyType({}),
) -> Path:
    """Write `report.html`, `diagnosis.json` and the figures to a folder, and return the path of the page.

    Args:
        diagnosis: the result to report.
        folder: existing folder.
        seed: seed of the diagnosis, for the head of the JSON.
        config: configuration of the diagnosis, for the head of the JSON.
        beside: further files of the folder to which the page leads, with the text of each link.
    Raises: OSError: if the folder cannot be written.
    """
    folder = Path(folder)
    require_writable(folder / PAGE)
    pictures = {name: png(figure) for name, figure in figures(diagnosis).items()}
    page = render(diagnosis, pictures, seed=seed, beside=beside)
    for name in set(PICTURES) - set(pictures):
        (folder / f"{name}.png").unlink(missing_ok=True)  # of an earlier diagnosis
    for name, picture in pictures.items():
        write_bytes(folder / f"{name}.png", picture)
    write_json(folder / DATA, with_head(as_json(diagnosis), seed=seed, config=config or {}))
    write_text(folder / PAGE, page)
    return folder / PAGE


def with_head(content: dict[str, Any], *, seed: int, config: dict[str, Any]) -> dict[str, Any]:
    """Return the content after the head that every file of the project begins with (docs/reference/files.md)."""
    head = {"schema": content["schema"], "version": version("np_drake"), "seed": seed, "config": config}
    return {**head, **content}


def figures(diagnosis: Diagnosis) -> dict[str, Figure]:
    """Return by name the figures for which the diagnosis has data."""
    localisation, reduction = diagnosis.localisation, diagnosis.gap_reduction
    out: dict[str, Figure] = {}
    if reduction.ladder:
        out["ladder"] = ladder_figure(reduction)
    if localisation.regimes:
        out["regimes"] = regime_figure(localisation.regimes)
    if localisation.times:
        out["timeline"] = timeline_figure(localisation, _onsets(diagnosis))
    if localisation.bands:
        out["spectrum"] = spectrum_figure(localisation.bands)
    if reduction.replay_before is not None or reduction.replay_after is not None:
        out["replay"] = replay_figure(reduction.replay_before, reduction.replay_after)
    return out


def _onsets(diagnosis: Diagnosis) -> dict[str, list[tuple[str, float]]]:
    """Return by flight the (effect, time [s]) of every cause that begins in it."""
    out: dict[str, list[tuple[str, float]]] = {}
    for cause in diagnosis.causes:
        for flight, time in cause.onset.items():
            if time is not None and math.isfinite(time):
                out.setdefault(flight, []).append((cause.identifier, time))
    return out
