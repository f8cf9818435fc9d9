"""The list of all formats of flight logs, and which of them a file is of."""

from pathlib import Path

from np_drake.checks import require
from np_drake.logs.errors import LogError
from np_drake.logs.formats.blackbox import BLACKBOX
from np_drake.logs.formats.crazyflie import CRAZYFLIE
from np_drake.logs.formats.dataflash import DATAFLASH
from np_drake.logs.formats.format import Format, first_bytes
from np_drake.logs.formats.ros import ROS
from np_drake.logs.formats.table import NEURAL_FLY, TABLE
from np_drake.logs.formats.telemetry import TELEMETRY
from np_drake.logs.formats.text_table import encoding_of
from np_drake.logs.formats.ulog import ULOG

FORMATS: tuple[Format, ...] = (  # the first that recognises a file reads it
    CRAZYFLIE,
    BLACKBOX,
    ULOG,
    DATAFLASH,
    TELEMETRY,
    ROS,
    NEURAL_FLY,
    TABLE,  # any CSV: last
)


KNOWN = {  # beginning of a file that is no log yet: what it is, and how it becomes one
    b"ULogEnc": "an encrypted PX4 log; decrypt it with the private key of its vehicle (PX4's "
    "Tools/decrypt_ulog.py), and give the .ulg",
    b"version https://git-lfs": "a pointer of Git LFS, without the file; run git lfs pull",
    b"<!DOCTYPE html": "a web page; download the log itself",
    b"<html": "a web page; download the log itself",
    b"PK\x03\x04": "a zip archive; unpack it, and give the log in it",
    b"7z\xbc\xaf\x27\x1c": "a 7-Zip archive; unpack it, and give the log in it",
    b"\x89HDF": "an HDF5 file; write its columns as a table",
    b"MATLAB 5.0": "a file of MATLAB; write its columns as a table",
}
ZEROS = "only zeros, as a card leaves it that lost its power; copy it again from the vehicle"


def format_of(path: str | Path, name: str = "") -> Format:
    """Return the format of a file, by its first bytes and its name.
    Raises: LogError: if it is of none, or there is none of the name; OSError: if it cannot be
        opened.
    """
    path = Path(path)
    start = first_bytes(path)
    for beginning, what in (KNOWN | {bytes(max(len(start), 1)): ZEROS}).items():
        require(
            not start.startswith(beginning),
            f"{path}: must hold a flight log; it is {what}.",
            LogError,
        )
    if name:
        if name not in (names := {known.name: known for known in FORMATS}):
            raise LogError(
                f"{path}: the map's format must be one of {', '.join(names)}; got {name!r}."
            )
        return names[name]
    require(
        start or path.is_dir(),
        f"{path}: must hold a flight log; it is empty. Copy it again from the vehicle.",
        LogError,
    )
    for known in FORMATS:
        if known.recognises(path, start):
            return known
    titles = ", ".join(f"{f.name} ({f.title})" for f in FORMATS)
    raise LogError(
        f"{path}: must be a flight log of a known format: {titles}.{_remedy(path, start)}"
    )


def _remedy(path: Path, start: bytes) -> str:
    """Return how a text or a folder becomes a log; empty for other files."""
    if path.is_dir():
        return " Of a folder name its files."
    if encoding_of(start) == "utf-16":
        return " Save the text as UTF-8."
    if encoding_of(start) == "cp1252" or b"\x00" in start:
        return ""
    return (
        " A table must be named .csv, .tsv or .txt, its columns apart by comma, semicolon or tab."
    )
