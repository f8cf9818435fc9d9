"""Files read within a size limit, and written whole or not at all: beside the target under a
temporary name, to the disk, then renamed; the protection of what is read from being written, and
the lock by which a run holds its outputs for itself.

A file of 10 MB, whatever it holds, is read or refused within 1 GB of memory.
"""

import errno
import gzip
import json
import logging
import os
import secrets
import shutil
import stat
import tempfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from np_drake.checks import require

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
    require(
        len(content) <= most, f"{path}: must hold at most {most / 1e6:g} MB. Is it the right file?"
    )
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
    require(
        len(content) <= most,
        f"{path}: must hold at most {most / 1e6:.0f} MB. Is it the right file?",
    )
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
    guarded = _guarded.get()
    file = _identity(path)
    if guarded is not None and file is not None:
        guarded.setdefault(file, Path(path))


def note_output(path: str | Path) -> None:
    """Add a file that was written, which is no input when it is read."""
    guarded = _guarded.get()
    file = _identity(path)
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
    status = os.stat(path) if os.path.isfile(path) else None
    return None if status is None else (status.st_dev, status.st_ino)


FULL = (errno.ENOSPC, errno.EDQUOT)  # what a system says where no room is left
LOCK = ".np-drake.lock"  # in a folder; beside a file behind its name


def require_writable(path: str | Path) -> Path:
    """Return the path if a file can be written there, so that a caller can check before long work.

    Raises: OSError: if it is a folder, a device or an input, or its folder does not exist or cannot
    be written.
    """
    path = Path(path)
    target = Path(os.path.realpath(path))  # of the file itself, where the path is a link
    require(
        not path.is_dir(), f"{path}: must be a file to write; it is a folder.", IsADirectoryError
    )
    require(
        target.parent.is_dir(),
        f"{path}: the folder {target.parent} must exist; create it or choose another.",
        FileNotFoundError,
    )
    require(
        is_regular(path),
        f"{path}: must be an ordinary file to write; it is a device. Choose another.",
        PermissionError,
    )
    require_no_input(path)
    require(
        os.access(target.parent, os.W_OK),
        f"{path}: the folder {target.parent} must be writable; choose another.",
        PermissionError,
    )
    return path


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path` with the same suffixes, renamed on success and removed
    on failure.

    Where `path` is a link to a file, that file is replaced.
    Raises: OSError: as `require_writable`, and with the file where there is no room.
    """
    path = require_writable(path)
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{secrets.token_hex(4)}_{target.name}")
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)  # some writers are stricter than open() would be
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())  # so that it survives a power cut
        require_no_input(path)  # again: it may have been read since
        os.replace(temporary, target)
        note_output(target)
    except OSError as error:
        if error.errno in FULL:
            free = shutil.disk_usage(target.parent).free / 1e6
            error.filename = str(path)
            error.strerror = f"{error.strerror} ({free:.3g} MB are free)"
        raise
    finally:
        temporary.unlink(missing_ok=True)


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write a binary file, whole or not at all; OSError as `atomic_path`."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def write_text(path: str | Path, text: str) -> None:
    """Write a UTF-8 text file, whole or not at all."""
    write_bytes(path, text.encode("utf-8"))


def write_json(path: str | Path, content: Any) -> None:
    """Write indented JSON; NumPy numbers and arrays become lists, NaN and infinity become null."""
    write_text(path, json.dumps(plain(content), indent=2, allow_nan=False) + "\n")


def plain(value: Any) -> Any:
    """Convert a value to JSON's own types: dict, list, str, int, float, bool, None."""
    if hasattr(value, "tolist"):  # NumPy scalars and arrays
        value = value.tolist()
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if -float("inf") < value < float("inf") else None
    return str(value) if isinstance(value, Path) else value


def is_regular(path: Path) -> bool:
    """Return whether a path is that of an ordinary file, or of nothing yet."""
    return path.is_file() or not path.exists()


@contextmanager
def lock_outputs(folders: Iterable[Path], files: Iterable[Path] = ()) -> Iterator[None]:
    """Hold the outputs of a run for itself until the end of the block; the lock files go with it.

    A folder is made where it is missing, and removed where it is still empty at the end. The system
    drops the lock of a process that dies: the lock file that it leaves behind holds nobody up.
    Raises: OSError: if another run holds one of them, or there is no place for the lock file.
    """
    with ExitStack() as locks:
        for folder in {folder.resolve(): folder for folder in folders}.values():
            if not folder.exists():
                folder.mkdir(parents=True, exist_ok=True)
                locks.callback(_remove_empty, folder)
            locks.enter_context(_locked(folder / LOCK, folder))
        for file in files:
            target = file.resolve()
            locks.enter_context(_locked(target.with_name(f".{target.name}{LOCK}"), file))
        yield


@contextmanager
def _locked(path: Path, output: Path) -> Iterator[None]:
    try:
        with FileLock(path, timeout=0):
            try:
                yield
            finally:
                path.unlink(missing_ok=True)
    except Timeout as error:
        raise OSError(
            f"{output}: another run writes here. Wait for its end, or choose another --out."
        ) from error


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):  # it holds results
        folder.rmdir()
