"""Guard of the files that a run reads: within it none of them is written, by whatever name."""

import dataclasses as dc
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

Identity = tuple[int, int]  # device and inode of a file, the same for all its links


@dc.dataclass
class _Guard:
    """Files that are read, that are to be written, and that this run has written itself and may write again."""

    inputs: dict[Identity, Path] = dc.field(default_factory=dict)
    outputs: set[str] = dc.field(default_factory=set)
    own: set[Identity] = dc.field(default_factory=set)


_guard: ContextVar[_Guard | None] = ContextVar("guard", default=None)


@contextmanager
def guard_inputs(paths: Iterable[str | Path]) -> Iterator[None]:
    """Protect files, and those that `note_input` adds, from being written until the end of the block."""
    token = _guard.set(_Guard())
    try:
        for path in paths:
            note_input(path)
        yield
    finally:
        _guard.reset(token)


def note_input(path: str | Path) -> None:
    """Add a file that is read; without effect outside `guard_inputs` and for a file of this run's own.

    Raises: FileExistsError: if it is to be written, so that a run ends here, and not after its work.
    """
    guard, file = _guard.get(), _identity(path)
    if guard is None or file is None or file in guard.own:
        return
    guard.inputs.setdefault(file, Path(path))
    for output in guard.outputs:
        if _identity(output) == file:
            raise _is_read(output, path)


def note_output(path: str | Path) -> None:
    """Add a file that was written, which is no input when it is read."""
    guard, file = _guard.get(), _identity(path)
    if guard is not None and file is not None:
        guard.own.add(file)
        guard.outputs.discard(os.path.abspath(path))


def require_no_input(path: str | Path) -> None:
    """Check that a file to write is none that is read, and let none that is read later be it.

    Raises: FileExistsError: if it is, also as a link to one.
    """
    guard, file = _guard.get(), _identity(path)
    source = guard.inputs.get(file) if guard is not None and file is not None else None
    if source is not None:
        raise _is_read(path, source)
    if guard is not None and file is not None:
        guard.outputs.add(os.path.abspath(path))


def _is_read(path: str | Path, source: str | Path) -> FileExistsError:
    also = "" if os.path.abspath(source) == os.path.abspath(path) else f" (the same file as {source})"
    return FileExistsError(f"{path}: must not be a file that is read{also}. Choose another.")


def _identity(path: str | Path) -> Identity | None:
    """Return what tells a file apart; None where there is none, or where it is no ordinary file."""
    if not os.path.isfile(path):
        return None
    found = os.stat(path)
    return found.st_dev, found.st_ino
