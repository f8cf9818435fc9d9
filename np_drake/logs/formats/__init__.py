"""Formats of flight logs: one file each, and the list of them all."""

import codecs
from pathlib import Path

from np_drake.logs.errors import LogError
from np_drake.logs.formats.crazyflie import CRAZYFLIE
from np_drake.logs.formats.dataflash import DATAFLASH
from np_drake.logs.formats.format import Format, first_bytes
from np_drake.logs.formats.neural_fly import NEURAL_FLY
from np_drake.logs.formats.ros import ROS
from np_drake.logs.formats.table import TABLE
from np_drake.logs.formats.ulog import ULOG

FORMATS: tuple[Format, ...] = (  # the first that recognises a file reads it
    CRAZYFLIE,
    ULOG,
    DATAFLASH,
    ROS,
    NEURAL_FLY,
    TABLE,  # any CSV: last
)

__all__ = ["FORMATS", "Format", "format_named", "format_of"]


def format_of(path: str | Path) -> Format:
    """Return the format of a file, by its first bytes and its name.

    Raises: LogError: if it is of none; OSError: if it cannot be opened.
    """
    path = Path(path)
    start = first_bytes(path)
    if not start and not path.is_dir():
        raise LogError(f"{path}: must hold a flight log; it is empty. Copy it again from the vehicle.")
    for known in FORMATS:
        if known.recognises(path, start):
            return known
    titles = ", ".join(f"{f.name} ({f.title})" for f in FORMATS)
    raise LogError(f"{path}: must be a flight log of a known format: {titles}.{_remedy(path, start)}")


def _remedy(path: Path, start: bytes) -> str:
    """Return how a text or a folder becomes a log, from its first bytes; empty for other files."""
    if path.is_dir():
        return " Of a folder name its files."
    if start[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return " Save the text as UTF-8."
    try:
        start[: start.rfind(b"\n") + 1].decode()
    except UnicodeDecodeError:
        return ""
    if b"\x00" in start:
        return ""
    return " A table must be named .csv, .tsv or .txt, its columns apart by comma, semicolon or tab."


def format_named(name: str) -> Format:
    """Return the format of a name.

    Raises: ValueError: if there is none.
    """
    for known in FORMATS:
        if known.name == name:
            return known
    raise ValueError(f"format must be one of {', '.join(f.name for f in FORMATS)}; got {name!r}.")
