"""The report's folder: HTML page, JSON and figures, all made before anything is written."""

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any

from matplotlib.figure import Figure

from np_drake.diagnosis.report import answer as summary
from np_drake.diagnosis.report import words
from np_drake.diagnosis.report.answer import GAP_HEADER, gap_rows, headline, lead, remains
from np_drake.diagnosis.report.figures import regime_figure, replay_figure
from np_drake.diagnosis.result import Diagnosis
from np_drake.files.file_access import require_writable, write_json
from np_drake.files.page import Section, write_page

TEMPLATE = Path(__file__).with_name("report.html.j2")
PAGE, DATA = "report.html", "diagnosis.json"
PICTURES = ("regimes", "replay")


def content(diagnosis: Diagnosis, seed: int) -> dict[str, Any]:
    """Return all values that the template uses, with numbers formatted as text."""
    identifiability, reduction = diagnosis.identifiability, diagnosis.gap_reduction
    replays = (reduction.replay_before, reduction.replay_after)
    return {
        **answer(diagnosis),
        "refit": None if diagnosis.refit is None else answer(diagnosis.refit),
        "new_on_held_out": [finding.text.rstrip(".") for finding in diagnosis.new_on_held_out],
        "calibrated": bool(diagnosis.calibration),
        "difference_header": summary.DIFFERENCE_HEADER,
        "differences": summary.difference_rows(diagnosis),
        "next_steps": summary.next_steps(diagnosis),
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
        "warnings": summary.warnings(diagnosis),
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
    header, rows = summary.cause_table(diagnosis)
    return {
        "headline": headline(diagnosis),
        "lead": lead(diagnosis),
        "cause_header": header,
        "causes": rows,
        "gap_header": GAP_HEADER,
        "gap": gap_rows(diagnosis),
        "remains": remains(diagnosis),
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
    beside: Mapping[str, str] = MappingProxyType({}),
) -> Path:
    """Write `report.html`, `diagnosis.json` and the figures to a folder, and return the path of the
    page.

    Args:
        seed: seed of the diagnosis, for the head of the JSON.
        config: configuration of the diagnosis, for the head of the JSON.
        beside: further files of the folder to which the page leads, with the text of each link.
    Raises: OSError: if the folder cannot be written.
    """
    folder = Path(folder)
    require_writable(folder / PAGE)
    title = f"Sim-to-real diagnosis · {diagnosis.vehicle}"
    section = Section(TEMPLATE, content(diagnosis, seed) | {"beside": beside})
    write_page(folder / PAGE, title, [section], dict.fromkeys(PICTURES) | figures(diagnosis))
    found = diagnosis.as_json()
    # The head that every file of the project begins with (docs/reference/files.md).
    head = {"schema": found["schema"], "version": version("np_drake"), "seed": seed}
    write_json(folder / DATA, {**head, "config": config or {}, **found})
    return folder / PAGE


def figures(diagnosis: Diagnosis) -> dict[str, Figure]:
    """Return by name the figures for which the diagnosis has data."""
    regimes, reduction = diagnosis.localisation.regimes, diagnosis.gap_reduction
    out: dict[str, Figure] = {}
    if regimes:
        out["regimes"] = regime_figure(regimes)
    if reduction.replay_before is not None or reduction.replay_after is not None:
        out["replay"] = replay_figure(reduction.replay_before, reduction.replay_after)
    return out
