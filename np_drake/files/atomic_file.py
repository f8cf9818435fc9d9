"""Files written whole or not at all: beside the target under a temporary name, to the disk, then
renamed.
"""

import errno
import json
import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from np_drake.files.input_file import note_output, require_no_input

FULL = (errno.ENOSPC, errno.EDQUOT)  # what a system says where no room is left


class DiskFull(OSError):
    """Lack of room on the disk, in one line: which file, how much it needs, what is free, and the
    remedy.
    """


def require_writable(path: str | Path) -> Path:
    """Return the path if a file can be written there, so that a caller can check before long work.

    Raises: OSError: if it is a folder, a device or an input, or its folder does not exist or cannot
    be written.
    """
    path = Path(path)
    if _is_sink(path):
        return path
    if path.is_dir():
        raise IsADirectoryError(f"{path}: must be a file to write; it is a folder.")
    folder = _resolved(path).parent  # of the file itself, where the path is a link
    if not folder.is_dir():
        raise FileNotFoundError(
            f"{path}: the folder {folder} must exist; create it or choose another."
        )
    if path.exists() and not stat.S_ISREG(path.stat().st_mode):
        raise PermissionError(
            f"{path}: must be an ordinary file to write; it is a device. Choose another."
        )
    require_no_input(path)
    probe = folder / f".{secrets.token_hex(4)}"
    try:
        probe.touch()
        probe.unlink()
    except OSError as error:
        if error.errno in FULL:
            raise _full(path, 0) from error
        text = f"{path}: the folder {folder} must be writable ({error.strerror}); choose another."
        raise PermissionError(text) from error
    return path


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path` with the same suffixes, renamed on success and removed
    on failure.

    Where `path` is a link to a file, that file is replaced. What is written to /dev/null is
    discarded.
    Raises: OSError: as `require_writable`; DiskFull: if there is no room, with the size that was
        written until then.
    """
    path = require_writable(path)
    if _is_sink(path):
        with tempfile.TemporaryDirectory() as folder:
            yield Path(folder) / path.name
        return
    target = path.resolve()
    temporary = target.with_name(f".{secrets.token_hex(4)}_{target.name}")
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)  # some writers are stricter than open() would be
        _to_disk(temporary)
        require_no_input(path)  # again: it may have been read since
        os.replace(temporary, target)
        note_output(target)
        _to_disk(target.parent)
    except OSError as error:
        if error.errno in FULL:
            raise _full(path, temporary.stat().st_size if temporary.exists() else 0) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write a binary file, whole or not at all.
    Raises: OSError: as `atomic_path`; DiskFull: before anything is written where it does not fit.
    """
    with atomic_path(path) as temporary:
        if not _is_sink(Path(path)) and shutil.disk_usage(temporary.parent).free < len(content):
            raise _full(path, len(content))
        temporary.write_bytes(content)


def write_text(path: str | Path, text: str) -> None:
    """Write a UTF-8 text file, whole or not at all."""
    write_bytes(path, text.encode("utf-8"))


def write_json(path: str | Path, content: Any) -> None:
    """Write indented JSON; NumPy numbers and arrays become lists, NaN and infinity become null.

    Args:
        content: of any types that `plain` takes.
    """
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


def _resolved(path: Path) -> Path:
    """Return where a path leads, through its links; OSError if they lead to themselves."""
    try:
        return path.resolve()
    except RuntimeError as error:
        raise OSError(f"{path}: must not be symbolic links in a circle. Choose another.") from error


def _is_sink(path: Path) -> bool:
    """Return whether a path is /dev/null, also by another name; a rename would replace the device
    by a file.
    """
    try:
        found = path.stat()
    except OSError:
        return False
    return stat.S_ISCHR(found.st_mode) and found.st_rdev == os.stat(os.devnull).st_rdev


def _to_disk(path: Path) -> None:
    """Wait until a file, or a folder's list of names, is on the disk and survives a power cut."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def _full(path: str | Path, size: int) -> DiskFull:
    """Return the error of a file of at least `size` bytes that finds no room."""
    folder = Path(path).resolve().parent
    free = shutil.disk_usage(folder).free
    needs = f"at least {size / 1e6:.3g} MB" if size else "more than there is"
    return DiskFull(
        f"{path}: must have room on the disk, {needs}; {free / 1e6:.3g} MB are free in {folder}. "
        "Free some, or choose another folder."
    )
