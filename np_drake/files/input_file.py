"""Reading of input files within a size limit, and their protection from being written.

A file of 10 MB, whatever it holds, is read or refused within 1 GB of memory.
"""

import gzip
import json
import logging
import os
import stat
import tempfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

logger = logging.getLogger(__name__)

# Limits, own choice: beyond them a file is damaged, or made to fill the memory of its reader.
MAX_JSON = 200 * 10**6  # [byte]
GZIP = b"\x1f\x8b"  # first bytes
LEAST_CELLS = 4 * 10**6  # numbers that any table may hold: 20 minutes of 30 columns at 100 Hz
LEAST_TEXT = 10**8  # [byte] that any file may hold after decompression
TEXT_A_BYTE = 50  # further ones a byte of the file; compressed logs have 2 to 20, gzip at most 1032


def read_bytes(path: str | Path, most: int, *, kept: bool = False) -> bytes:
    """Return the content of a file of at most `most` bytes; `kept`: of an earlier run, and no
    input.

    Raises: ValueError: if it holds more, or is a pipe; OSError: if it cannot be read.
    """
    require_plain_file(path)
    with Path(path).open("rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise ValueError(f"{path}: must hold at most {most / 1e6:g} MB. Is it the right file?")
    if not kept:
        note_input(path)
    return content


def require_plain_file(path: str | Path) -> None:
    """Check that reading a path can end: a named pipe without a writer blocks at its opening, and a
    socket has no end.

    Raises: ValueError: if it is one.
    """
    mode = os.stat(path).st_mode if os.path.exists(path) else 0
    if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode):
        kind = "named pipe" if stat.S_ISFIFO(mode) else "socket"
        raise ValueError(
            f"{path}: must be a file or a folder; got a {kind}, which may never end. Save "
            f"it as a file."
        )


def read_json(path: str | Path) -> Any:
    """Return the content of a JSON file.

    Raises: ValueError: if it is none, nested too deeply, or beyond `MAX_JSON`; OSError: if it
    cannot be read.
    """
    return parse_json(read_bytes(path, MAX_JSON))


def kept_json(path: str | Path) -> Any | None:
    """Return the result of an earlier run; None where there is none or it was cut off, so that it
    is made again.

    Raises: OSError: if it cannot be read.
    """
    try:
        return parse_json(read_bytes(path, MAX_JSON, kept=True))
    except FileNotFoundError:
        return None
    except ValueError:
        logger.warning("%s: is cut off or no JSON; it is made again.", path)
        return None


def parse_json(text: str | bytes) -> Any:
    """Return what a JSON text holds; ValueError if it is none, or nested too deeply."""
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("must not be nested as deeply as this.") from error


def cell_budget(path: str | Path) -> int:
    """Return how many numbers a table may hold: one more a byte of its file."""
    return LEAST_CELLS + size_of(path)


def text_budget(path: str | Path) -> int:
    """Return how many bytes a file may hold after decompression, from its size."""
    return LEAST_TEXT + TEXT_A_BYTE * size_of(path)


def decompressed_start(start: bytes) -> bytes:
    """Return the first bytes of a file, decompressed where they are those of gzip; empty if they
    are damaged.
    """
    if not start.startswith(GZIP):
        return start
    try:
        return zlib.decompressobj(wbits=zlib.MAX_WBITS | 16).decompress(start, len(start))
    except zlib.error:
        return b""


def decompressed(path: str | Path) -> bytes:
    """Return the content of a file, decompressed where it is of gzip.

    Raises: ValueError: if it is damaged, or unpacks to more than `LEAST_TEXT` beyond its size;
    OSError: if it cannot be opened.
    """
    with Path(path).open("rb") as file:
        if file.peek(len(GZIP))[: len(GZIP)] != GZIP:
            return file.read()
        most = LEAST_TEXT + size_of(path)
        try:
            content = gzip.GzipFile(fileobj=file).read(most + 1)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise ValueError(f"{path}: must be a whole gzip file; copy it again.") from error
    if len(content) > most:
        raise ValueError(f"{path}: must hold at most {most / 1e6:.0f} MB. Is it the right file?")
    return content


@contextmanager
def uncompressed(path: Path) -> Iterator[Path]:
    """Yield a path to the content of a file: its own, or that of a copy while it is needed.

    Raises: as `decompressed`.
    """
    with path.open("rb") as file:
        if file.read(len(GZIP)) != GZIP:
            yield path
            return
    with tempfile.NamedTemporaryFile(suffix=path.suffix) as copy:
        copy.write(decompressed(path))
        copy.flush()
        yield Path(copy.name)


def size_of(path: str | Path) -> int:
    """Return the size of a file, or of the files in a folder together [byte]."""
    path = Path(path)
    files = [file for file in path.iterdir() if file.is_file()] if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files)


Identity = tuple[int, int]  # device and inode of a file, the same for all its links
# Files that are read, by the path that names them; None for one that this run has written itself,
# and may write again.
_guarded: ContextVar[dict[Identity | None, Path | None] | None] = ContextVar(
    "guarded", default=None
)


@contextmanager
def guard_inputs(paths: Iterable[str | Path]) -> Iterator[None]:
    """Protect files, and those that `note_input` adds, from being written until the end of the
    block.
    """
    token = _guarded.set({})
    try:
        for path in paths:
            note_input(path)
        yield
    finally:
        _guarded.reset(token)


def note_input(path: str | Path) -> None:
    """Add a file that is read; without effect outside `guard_inputs` and for a file of this run's
    own.

    Raises: ValueError: if it is a pipe or a socket.
    """
    require_plain_file(path)
    guarded, file = _guarded.get(), _identity(path)
    if guarded is not None and file is not None:
        guarded.setdefault(file, Path(path))


def note_output(path: str | Path) -> None:
    """Add a file that was written, which is no input when it is read."""
    guarded, file = _guarded.get(), _identity(path)
    if guarded is not None and file is not None:
        guarded[file] = None


def is_own(path: str | Path) -> bool:
    """Return whether this run has written a file itself; False outside `guard_inputs`."""
    return (_guarded.get() or {}).get(_identity(path), Path(path)) is None


def require_no_input(path: str | Path) -> None:
    """Check that a file to write is none that is read; FileExistsError if it is, also as a link."""
    source = (_guarded.get() or {}).get(_identity(path))
    if source is not None:
        same = os.path.abspath(source) == os.path.abspath(path)
        also = "" if same else f" (the same file as {source})"
        raise FileExistsError(f"{path}: must not be a file that is read{also}. Choose another.")


def _identity(path: str | Path) -> Identity | None:
    """Return what tells a file apart; None where there is none, or where it is no ordinary file."""
    found = os.stat(path) if os.path.isfile(path) else None
    return None if found is None else (found.st_dev, found.st_ino)
