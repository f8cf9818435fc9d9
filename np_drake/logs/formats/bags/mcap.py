"""Reads MCAP files as ROS 2 records them, whole or cut off.

A record is a byte that says its kind, its length in 8 bytes, and its content; a chunk holds records, compressed or not.
Where the file has an index, only the chunks of the wanted topics are unpacked, one after the other.
Source: MCAP format specification.
"""

import itertools
import struct
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from np_drake.logs.errors import LogError
from np_drake.logs.formats.bags.budget import Budget, Channel, MappedBag, Record, unpacked_exactly

MAGIC = b"\x89MCAP0\r\n"
NONE, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, CHUNK_INDEX, STATISTICS, DATA_END = 0, 2, 3, 4, 5, 6, 8, 11, 15
FOOTER_START = b"\x02\x14" + bytes(7)  # its kind and length
FOOTER_SIZE = 29 + len(MAGIC)
LANGUAGES = {"ros2msg": "MSG", "ros2idl": "IDL", "omgidl": "IDL"}
Place = tuple[int, int, int]  # of a record: kind, start and end of the content


class Mcap(MappedBag):
    """Channels and messages of an MCAP file."""

    def __init__(self, path: Path, budget: Budget) -> None:
        """Find all channels and how many messages they have.

        Raises: ValueError: if there is no message; LogError: beyond the budget.
        """
        super().__init__(path, budget)
        self._schemas: dict[int, tuple[str, str, str]] = {}  # name, language, definition
        self._found: dict[int, tuple[str, int]] = {}  # topic, number of the schema
        summary = self._summary()
        self.whole = summary is not None
        if not summary or not self._read_index(summary):
            self._scan()
        self.channels = [self._channel(n) for n in self._found if self.whole or self._counts[n]]
        if not self.channels:
            raise ValueError("no whole record of messages is in it")

    def _stamp(self, record: Record) -> tuple[int, int, int] | None:
        data, kind, at, end = record
        if kind != MESSAGE or end - at < 22:
            return None
        number, _, time, _ = struct.unpack_from("<HIQQ", data, at)
        return number, time, at + 22

    def _summary(self) -> int | None:
        """Return where the summary begins, 0 where there is none; None where the end of the file is cut off."""
        tail = self._bytes[-FOOTER_SIZE:]
        if not tail.endswith(MAGIC) or not tail.startswith(FOOTER_START):
            return None
        (start,) = struct.unpack_from("<Q", tail, len(FOOTER_START))
        return start if start <= len(self._bytes) - FOOTER_SIZE else 0

    def _read_index(self, start: int) -> bool:
        """Learn all from the summary; return whether it says enough."""
        counted = False
        try:
            for kind, at, end in _records(self._bytes, start, len(self._bytes) - FOOTER_SIZE):
                if kind == CHUNK_INDEX:
                    self._chunks.append(_place(self._bytes, at, end))
                elif kind == STATISTICS:
                    self._counts.update(_counts(self._bytes, at, end))
                    counted = True
                else:
                    self._learn(self._bytes, kind, at, end)
        except (ValueError, struct.error) as error:
            if isinstance(error, LogError):
                raise
            counted = False
        if counted and self._schemas and self._found:
            return True
        self._counts.clear()
        self._chunks.clear()
        return False

    def _scan(self) -> None:
        """Learn all by a pass through the file, up to the first damage."""
        try:
            for data, kind, at, end in self._records(()):
                if kind == MESSAGE and end - at >= 22:
                    self._counts[struct.unpack_from("<H", data, at)[0]] += 1
                else:
                    self._learn(data, kind, at, end)
        except (ValueError, struct.error) as error:
            if isinstance(error, LogError):
                raise

    def _learn(self, data: Any, kind: int, at: int, end: int) -> None:
        """Take in a schema or channel that is not known yet."""
        if kind not in (SCHEMA, CHANNEL):
            return
        (number,) = struct.unpack_from("<H", data, at)
        if kind == SCHEMA and number not in self._schemas:
            name, at = _text(data, at + 2, end)
            encoding, at = _text(data, at, end)
            definition, _ = _text(data, at, end)
            language = LANGUAGES.get(encoding.decode("utf-8", "replace"), "")
            self._schemas[number] = self._budget.text(name), language, self._budget.text(definition)
        if kind == CHANNEL and number not in self._found:
            (schema,) = struct.unpack_from("<H", data, at + 2)
            topic, _ = _text(data, at + 4, end)
            self._budget.add_channel()
            self._found[number] = self._budget.text(topic), schema

    def _channel(self, number: int) -> Channel:
        topic, schema = self._found[number]
        return Channel(number, topic, *self._schemas.get(schema, ("", "", "")), self._counts[number])

    def _records(self, wanted: Collection[int]) -> Iterator[Record]:
        take = self._budget.one_pass()
        for kind, at, end in self._top(frozenset(wanted)):
            if kind != CHUNK:
                yield self._bytes, kind, at, end
                continue
            size, checksum, compression, at, end = _chunk(self._bytes, at, end)
            if not compression:
                yield from ((self._bytes, *record) for record in _records(self._bytes, at, end))
                continue
            take(size)
            data = unpacked_exactly(compression, self._bytes[at:end], size)
            if checksum and zlib.crc32(data) != checksum:
                raise ValueError("the checksum of a chunk is wrong")
            yield from ((data, *record) for record in _records(data, 0, size))

    def _top(self, wanted: frozenset[int]) -> Iterator[Place]:
        """Yield the records of the file itself; with an index the chunks of the wanted channels alone, each once."""
        if not self._chunks:
            yield from _records(self._bytes, len(MAGIC), len(self._bytes))
        for start in sorted({start for start, has in self._chunks if not has or has & wanted}):
            yield from itertools.islice(_records(self._bytes, start, len(self._bytes)), 1)


def _records(data: Any, at: int, size: int) -> Iterator[Place]:
    """Yield all whole records up to the end of the data, of the file or of its part with messages."""
    while at + 9 <= size:
        kind, length = struct.unpack_from("<BQ", data, at)
        end = at + 9 + length
        if kind in (NONE, FOOTER, DATA_END) or end > size:
            return
        yield kind, at + 9, end
        at = end


def _text(data: Any, at: int, end: int) -> tuple[bytes, int]:
    """Return a text with its length before it, and where it ends.

    Raises: ValueError: if it is longer than its record.
    """
    stop = at + 4 + struct.unpack_from("<I", data, at)[0]
    if stop > end:
        raise ValueError("a record is damaged")
    return data[at + 4 : stop], stop


def _chunk(data: Any, at: int, end: int) -> tuple[int, int, str, int, int]:
    """Return the claimed size of a chunk, its checksum and compression, and where its records begin and end."""
    _, _, size, checksum = struct.unpack_from("<QQQI", data, at)
    compression, at = _text(data, at + 28, end)
    stop = at + 8 + struct.unpack_from("<Q", data, at)[0]
    if stop > end:
        raise ValueError("a chunk is damaged")
    return size, checksum, compression[:20].decode("utf-8", "replace"), at + 8, stop


def _place(data: Any, at: int, end: int) -> tuple[int, frozenset[int]]:
    """Return where a chunk begins, and the channels that have messages in it."""
    start = struct.unpack_from("<Q", data, at + 16)[0]
    raw, _ = _text(data, at + 32, end)
    return start, frozenset(number for number, _ in struct.iter_unpack("<HQ", raw))


def _counts(data: Any, at: int, end: int) -> dict[int, int]:
    """Return the number of messages by channel."""
    raw, _ = _text(data, at + 42, end)
    return dict(struct.iter_unpack("<HQ", raw))
