"""Files written whole or not at all: beside the target under a temporary name, to the disk, then
renamed; and the lock by which a run holds them for itself.
"""

import errno
import json
import os
import secrets
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from np_drake.files.input_file import note_output, require_no_input

FULL = (errno.ENOSPC, errno.EDQUOT)  # what a system says where no room is left
LOCK = ".np-drake.lock"  # in a folder; beside a file behind its name


def require_writable(path: str | Path) -> Path:
    """Return the path if a file can be written there, so that a caller can check before long work.

    Raises: OSError: if it is a folder, a device or an input, or its folder does not exist or cannot
    be written.
    """
    path = Path(path)
    target = Path(os.path.realpath(path))  # of the file itself, where the path is a link
    if path.is_dir():
        raise IsADirectoryError(f"{path}: must be a file to write; it is a folder.")
    if not target.parent.is_dir():
        raise FileNotFoundError(
            f"{path}: the folder {target.parent} must exist; create it or choose another."
        )
    if not is_regular(path):
        raise PermissionError(
            f"{path}: must be an ordinary file to write; it is a device. Choose another."
        )
    require_no_input(path)
    if not os.access(target.parent, os.W_OK):
        raise PermissionError(
            f"{path}: the folder {target.parent} must be writable; choose another."
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
            error.filename = str(path)
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
    with ExitStack() as held:
        for folder in {folder.resolve(): folder for folder in folders}.values():
            if not folder.exists():
                folder.mkdir(parents=True, exist_ok=True)
                held.callback(_remove_empty, folder)
            held.enter_context(_locked(folder / LOCK, folder))
        for file in files:
            target = file.resolve()
            held.enter_context(_locked(target.with_name(f".{target.name}{LOCK}"), file))
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
