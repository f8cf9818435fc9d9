"""Whole and damaged ULog files, parsed with pyulog (extra `ulog`) to an end and within bounds.

Source: PX4 user guide, "ULog File Format".
"""

import contextlib
import dataclasses as dc
import io
import itertools
import struct
from array import array
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

from np_drake.logs.errors import LogError, optional_package
from np_drake.logs.formats.format import Progress, no_progress

LARGEST_MESSAGE = 65_535  # [bytes], its size is a uint16
DEEPEST = 16  # messages in messages
MOST_FIELDS = 200_000  # of all subscriptions together
REMEDY = "copy it again from the vehicle"


class _Circles(Exception):
    """A damaged file sends its reader back and forth."""


@dc.dataclass
class Subscription:
    """One stream of a log: its fields, the size of a row [bytes], and the number of its rows."""

    name: str
    columns: tuple[str, ...]
    size: int
    rows: int = 0


class Guarded:
    """A file that counts what is read of it, so that a damaged one comes to an end, and says how
    far it is.

    cut: the last read wanted more than there was, and was not that of a message's three bytes at
    the end.

    Args:
        size: of it [byte].
        progress: called with the share that is read [1].
    """

    def __init__(self, file: BinaryIO, size: int, progress: Progress) -> None:
        self._file = file
        self._size = max(size, 1)
        self._progress = progress
        self._calls = 8 * size + 1000
        self._bytes = 100 * size + (256 << 20)
        self.cut = False

    def read(self, count: int) -> bytes:
        """Read bytes.

        Raises: _Circles: if far more was read than a file of this size takes.
        """
        data = self._file.read(count)
        self.cut = len(data) < count and (count != 3 or bool(data))
        self._calls -= 1
        self._bytes -= len(data)
        if self._calls < 0 or self._bytes < 0:
            raise _Circles("its messages lead in circles")
        if not self._calls & 0x3FFF:
            self._progress(min(self._file.tell() / self._size, 1.0))
        return data

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go to a place.

        Args:
            offset: [byte].
            whence: from where it counts, as in `io`.
        Raises: _Circles: if it is before the file.
        """
        try:
            return self._file.seek(offset, whence)
        except OSError as error:
            raise _Circles("its messages lead out of it") from error

    def tell(self) -> int:
        """Return the place."""
        return self._file.tell()

    def close(self) -> None:
        """Leave the file open: its owner closes it."""


def parse(
    path: Path, names: Sequence[str], progress: Progress
) -> tuple[Any, list[Subscription], Guarded]:
    """Return pyulog's log with the rows of the named messages alone, and all streams of the file.

    Args:
        progress: called with the share that is read [1].
    """
    pyulog = optional_package(
        "pyulog", path, "ULog needs pyulog; pip install 'np_drake[ulog]', or convert to CSV."
    )
    subscriptions: list[Subscription] = []
    with path.open("rb") as file:
        size = file.seek(0, 2)
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # pyulog prints its warnings
                file.seek(0)
                head = pyulog.ULog(Guarded(file, size, no_progress), parse_header_only=True)
                if any(b <= a for a, b in itertools.pairwise(head._appended_offsets)):
                    raise ValueError("its appended data lead back")  # and would be read twice
                fields = _field_counts(head.message_formats)
                file.seek(0)
                guarded = Guarded(file, size, progress)
                log = _scanner(pyulog, fields, subscriptions)(
                    guarded, message_name_filter_list=list(names)
                )
        except Exception as error:  # pyulog says what is wrong with a file in many ways
            reason = (str(error).splitlines() or [type(error).__name__])[0].rstrip(".")
            raise LogError(f"{path}: must be a whole ULog file; {reason}; {REMEDY}.") from error
    progress(1.0)
    return log, subscriptions, guarded


def _scanner(pyulog: Any, fields: Mapping[str, int], found: list[Subscription]) -> Any:
    """Return pyulog's parser, made to note every subscription and whether it has rows, also of what
    is not loaded.
    """
    by_id: dict[bytes, Subscription] = {}
    left = [MOST_FIELDS]

    class Added(pyulog.ULog._MessageAddLogged):  # type: ignore[misc]
        def __init__(self, data: bytes, header: Any, formats: Any) -> None:
            left[0] -= fields.get(data[3:].decode("utf-8", "ignore"), 0)
            if left[0] < 0:
                raise ValueError("more fields than a log has")  # pyulog leaves the message out
            super().__init__(data, header, formats)
            if self.timestamp_idx < 0 or self.field_data[self.timestamp_idx].type_str != "uint64_t":
                raise ValueError("a message without a time")
            name = stream_name(self.message_name, self.multi_id)
            columns = tuple(
                f.field_name for f in self.field_data if _is_column(f.field_name, f.type_str)
            )
            subscription = next((s for s in found if s.name == name), None)
            if subscription is None:
                subscription = Subscription(name, columns, self.dtype.itemsize)
                found.append(subscription)
            by_id[bytes(data[1:3])] = subscription

    class Row(pyulog.ULog._MessageData):  # type: ignore[misc]
        def initialize(self, data: bytes, header: Any, subscriptions: Any, log: Any) -> bool:
            subscription = by_id.get(bytes(data[:2]))
            if subscription is not None and len(data) - 2 >= subscription.size:
                subscription.rows += 1
            return bool(super().initialize(data, header, subscriptions, log))

    lost = array("H")  # [ms]

    class Dropout:
        """Notes a duration in place of an object; damaged logs have millions."""

        def __new__(cls, data: bytes, header: Any, timestamp: int) -> None:  # type: ignore[misc]
            lost.append(struct.unpack("<H", data)[0])

    class Scanner(pyulog.ULog):  # type: ignore[misc]
        _MessageAddLogged = Added
        _MessageData = Row
        MessageDropout = Dropout
        durations_lost = lost

    return Scanner


def _is_column(name: str, kind: str) -> bool:
    return (
        name != "timestamp"
        and kind != "char"
        and not name.rpartition(".")[2].startswith("_padding")
    )


def _field_counts(formats: Mapping[str, Any]) -> dict[str, int]:
    """Return the number of scalars in every message.

    Raises: ValueError: if a message holds itself, or more than a message can.
    """
    counts: dict[str, int] = {}

    def count(name: str, depth: int) -> int:
        if depth > DEEPEST:
            raise ValueError(f"the message {name[:40]!r} holds itself")
        if name not in counts and name in formats:
            fields = formats[name].fields
            counts[name] = sum(max(size, 1) * count(kind, depth + 1) for kind, size, _ in fields)
            if counts[name] > LARGEST_MESSAGE:
                raise ValueError(f"the message {name[:40]!r} is larger than a message can be")
        return counts.get(name, 1)

    return {name: count(name, 0) for name in formats}


def stream_name(message: str, instance: int) -> str:
    """Return the name of a stream: that of its message, and from the second instance on its number.

    Args:
        instance: number, from 0.
    """
    return f"{message}.{instance}" if instance else message
