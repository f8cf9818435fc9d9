"""Formats of export by name, and the table of what each carries."""

import dataclasses as dc
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from diagrams.exports import mujoco_xml, sdf
from diagrams.exports.carried import Carried, Law, how_carried
from np_drake.effects.base import SensorEffect
from np_drake.effects.library import effects_for
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class Format:
    """A format of export."""

    title: str
    write: Callable[[Vehicle, Sequence[Any], Path], list[Carried]]
    law: Law
    shape: str  # whether the file holds one, for the account


SHAPE = "approximate; a box as wide as the rotors reach collides, body, arms and discs are seen"
FORMATS = {
    "sdf": Format("SDF", sdf.write_sdf, sdf.LAW, SHAPE),
    "mujoco": Format("MuJoCo", mujoco_xml.write_mujoco, mujoco_xml.LAW, SHAPE),
}


def coverage() -> tuple[list[str], list[tuple[str, ...]]]:
    """Return header and rows of the table effect x format: exact, approximate or left out.

    Sensor errors, which every format leaves out, have no row.
    """
    rows = [
        (identifier, *(how_carried(effect, form.law)[0] for form in FORMATS.values()))
        for identifier, effect in effects_for("rotor_speed", neighbours=True).items()
        if not issubclass(effect, SensorEffect)
    ]
    return ["effect", *(form.title for form in FORMATS.values())], rows


def coverage_markdown() -> str:
    """Return the table as Markdown, as docs/guide/export.md shows it."""
    header, rows = coverage()
    lines = [f"| {' | '.join(header)} |", "|---" * len(header) + "|"]
    return "\n".join([*lines, *(f"| `{row[0]}` | {' | '.join(row[1:])} |" for row in rows)])
