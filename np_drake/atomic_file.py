"""Files written whole or not at all: beside the target under a temporary name, then renamed."""

import json
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def require_writable(path: str | Path) -> Path:
    """Return the path if a file can be written there, so that a caller can check before long work.

    Raises: OSError: if it is a folder, or its folder does not exist or cannot be written.
    """
    path = Path(path)
    if path.is_dir():
        raise IsADirectoryError(f"{path}: must be a file to write; it is a folder.")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: the folder {path.parent} must exist; create it or choose another.")
    probe = path.with_name(f".{secrets.token_hex(4)}")
    try:
        probe.touch()
        probe.unlink()
    except OSError as error:
        text = f"{path}: the folder {path.parent} must be writable ({error.strerror}); choose another."
        raise PermissionError(text) from error
    return path


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path` with the same suffixes, renamed on success and removed on failure.

    Raises: OSError: as `require_writable`.
    """
    path = require_writable(path)
    temporary = path.with_name(f".{secrets.token_hex(4)}_{path.name}")
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)  # some writers are stricter than open() would be
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a UTF-8 text file, whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


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
