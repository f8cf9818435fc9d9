"""Lock of a run's output: a second run into the same file or folder is refused, and mixes
nothing.
"""

import errno
import fcntl
import os
import platform
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

NAME = ".np-drake.lock"  # in a folder; beside a file behind its name
BUSY = (errno.EWOULDBLOCK, errno.EACCES)


class Occupied(OSError):
    """Output into which another run writes."""


@contextmanager
def lock_outputs(folders: Iterable[Path], files: Iterable[Path] = ()) -> Iterator[None]:
    """Hold the outputs of a run for itself until the end of the block; the lock files go with it.

    A folder is made where it is missing, and removed where it is still empty at the end. The system
    drops the lock of a process that dies, however it dies: the lock file that it leaves behind
    holds nobody up.
    Raises: Occupied: if another run holds one of them; OSError: if there is no place for the lock
        file.
    """
    with ExitStack() as held:
        for folder in {folder.resolve(): folder for folder in folders}.values():
            held.enter_context(_made(folder))
            held.enter_context(_locked(folder / NAME, folder))
        for file in files:
            target = file.resolve()
            held.enter_context(_locked(target.with_name(f".{target.name}{NAME}"), file))
        yield


@contextmanager
def _made(folder: Path) -> Iterator[None]:
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    finally:
        for path in missing:
            with suppress(OSError):  # it holds results
                path.rmdir()


@contextmanager
def _locked(path: Path, output: Path) -> Iterator[None]:
    number = _acquired(path, output)
    try:
        yield
    finally:
        # Before the lock is dropped: whoever waits for it looks for the name again.
        path.unlink(missing_ok=True)
        os.close(number)


def _acquired(path: Path, output: Path) -> int:
    """Return the open lock file; Occupied if another process holds it."""
    while True:
        try:
            number = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        except FileNotFoundError:
            if path.parent != output:
                raise
            output.mkdir(
                parents=True, exist_ok=True
            )  # a run that ended without results has removed it
            continue
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            holder = os.read(number, 200).decode(errors="replace").strip() or "another process"
            if error.errno in BUSY:
                os.close(number)
                raise Occupied(
                    f"{output}: another run ({holder}) writes here. Wait for its end, or "
                    f"choose another --out."
                ) from error
            # A file system without locks: the run goes on unguarded.
        if _is_still(number, path):
            os.truncate(number, 0)
            os.write(number, f"process {os.getpid()} on {platform.node()}".encode())
            return number
        os.close(number)  # its holder removed it in between


def _is_still(number: int, path: Path) -> bool:
    """Return whether an open file is that of the path."""
    try:
        return os.path.samestat(os.fstat(number), path.stat())
    except FileNotFoundError:
        return False
