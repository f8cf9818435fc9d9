"""The sheet beside an imported flight log: what was done, and what a row's command means."""

import dataclasses as dc
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from np_drake.checks import require
from np_drake.files.file_access import write_text
from np_drake.files.yaml_file import read_yaml
from np_drake.finding import Finding, Kind
from np_drake.logs.errors import LogError
from np_drake.vehicle.rotor_layout import RotorLayout

SUFFIX = ".import.yaml"
HEAD = (
    "# Sheet beside a flight log, as of np-drake import. `timing`, `start`, `rotors`, `motors`, "
    "`said` and `kinds` are read with the log; the rest is for people.\n"
)


@dc.dataclass(frozen=True)
class Sheet:
    """What was done to a log, the uncertainty of its commands' time, and where its rotors are.

    timing: standard deviation of the time at which a row's command acts [s].
    rotors: those of the columns of rotors; None: the log does not state them.
    motors: their names in the log that was recorded.
    content: everything else, for people.
    start: time of the source's clock at t = 0 [s].
    findings: what stays with the flights of the log.
    """

    timing: float = 0.0
    content: dict[str, Any] = dc.field(default_factory=dict)
    rotors: RotorLayout | None = None
    start: float = 0.0
    findings: tuple[Finding, ...] = ()
    motors: tuple[str, ...] = ()


def sheet_path(log: str | Path) -> Path:
    """Return the path of the sheet beside a log."""
    path = Path(log)
    return path.with_name(re.sub(r"(\.csv(\.gz)?|\.parquet)$", "", path.name) + SUFFIX)


def read_sheet(log: str | Path) -> Sheet:
    """Return the sheet beside a log; an empty one where there is none.

    Raises: LogError: if it is no sheet.
    """
    path = sheet_path(log)
    if not path.is_file():
        return Sheet()
    try:
        content = read_yaml(path)
        timing = float(content.pop("timing", 0.0))
        start = float(content.pop("start", 0.0))
        rotors = _layout(content.pop("rotors", None))
        motors = tuple(map(str, content.pop("motors", ())))
        lines = list(map(str, content.pop("said", ())))
        kinds = map(Kind, content.pop("kinds", ()) or map(_kind_of, lines))
        findings = [Finding(kind, "", line) for kind, line in zip(kinds, lines, strict=True)]
    except (AttributeError, TypeError, ValueError) as error:
        raise LogError(
            f"{path}: must be a sheet of np-drake import; write it again, or remove it."
        ) from error
    require(0 <= timing < 1, f"{path}: timing must be 0 to 1 s; got {timing}.", LogError)
    require(np.isfinite(start), f"{path}: start must be a time [s]; got {start}.", LogError)
    require(len(motors) in (0, 4), f"{path}: motors must name four rotors.", LogError)
    return Sheet(timing, content, rotors, start, tuple(findings), motors)


def write_sheet(sheet: Sheet, log: str | Path) -> Path:
    """Write the sheet beside a log, and return its path.
    Raises: OSError: if writing fails.
    """
    path = sheet_path(log)
    read: dict[str, Any] = {
        "timing": sheet.timing,
        "start": sheet.start or None,
        "rotors": sheet.rotors and json.loads(json.dumps(dc.asdict(sheet.rotors))),  # no tuples
        "motors": list(sheet.motors) or None,
        "said": list(map(str, sheet.findings)) or None,
        "kinds": [finding.kind.value for finding in sheet.findings] or None,
    }
    content = {name: value for name, value in read.items() if value is not None} | sheet.content
    write_text(path, HEAD + yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=110))
    return path


# Beginnings of lines of sheets that state no kinds; of all others readings are left out.
BEGINNINGS = {
    "no flight: ": Kind.NO_FLIGHT,
    "no multicopter: ": Kind.NO_MULTICOPTER,
    "fits ": Kind.STRETCH,
    "the log says: the accelerometer clips": Kind.CLIPPING,
    "the log says: ": Kind.VEHICLE,
    "the clock runs in ticks of ": Kind.COARSE_CLOCK,
}


def _kind_of(line: str) -> Kind:
    """Return the kind of a line of a sheet that states none."""
    kinds = (kind for beginning, kind in BEGINNINGS.items() if line.startswith(beginning))
    return next(kinds, Kind.LOST)


def _layout(content: Any) -> RotorLayout | None:
    """Return where the rotors are, as a sheet states it.

    Raises: ValueError, TypeError or AttributeError: if that is no layout of four rotors.
    """
    if content is None:
        return None
    positions = tuple((float(x), float(y)) for x, y in content.get("positions", ()))
    directions = tuple(float(sign) for sign in content.get("directions", ()))
    require(len(positions) == 4 and len(directions) == 4, "a layout has four rotors")
    return RotorLayout(positions, directions, str(content.get("source", "")))
