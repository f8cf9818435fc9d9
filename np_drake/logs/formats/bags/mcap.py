"""Reads MCAP files as ROS 2 records them, whole or cut off.

A record is a byte that says its kind, its length in 8 bytes, and its content; a chunk holds
records, compressed or not.
Source: MCAP format specification.
"""

import struct
from collections.abc import Iterator
from typing import Any

from np_drake.logs.errors import LogError
from np_drake.logs.formats.bags.budget import Channel
from np_drake.logs.formats.bags.mapped_bag import MappedBag, Record

MAGIC = b"\x89MCAP0\r\n"
NONE, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, CHUNK_INDEX, STATISTICS, DATA_END = (
    0,
    2,
    3,
    4,
    5,
    6,
    8,
    11,
    15,
)
FOOTER_START = b"\x02\x14" + bytes(7)  # its kind and length
FOOTER_SIZE = 29 + len(MAGIC)
LANGUAGES = {"ros2msg": "MSG", "ros2idl": "IDL", "omgidl": "IDL"}


class Mcap(MappedBag):
    """Channels and messages of an MCAP file."""

    _start = len(MAGIC)

    def _read_index(self) -> tuple[bool, bool]:
        self._schemas: dict[int, tuple[str, str, str]] = {}  # name, language, definition
        tail = self._bytes[-FOOTER_SIZE:]
        if not tail.endswith(MAGIC) or not tail.startswith(FOOTER_START):
            return False, False
        (start,) = struct.unpack_from("<Q", tail, len(FOOTER_START))
        end = len(self._bytes) - FOOTER_SIZE
        return True, 0 < start <= end and self._read_summary(start, end)

    def _read_summary(self, start: int, stop: int) -> bool:
        """Learn all from the summary; return whether it says enough."""
        counted = False
        try:
            for record in self._records(self._bytes, start, stop):
                data, kind, at, end = record
                if kind == CHUNK_INDEX:
                    has = frozenset(_counts(data, at + 32, end))
                    self._chunks.append((struct.unpack_from("<Q", data, at + 16)[0], has))
                elif kind == STATISTICS:
                    self._counts.update(_counts(data, at + 42, end))
                    counted = True
                else:
                    self._learn(record)
        except LogError:
            raise
        except (ValueError, struct.error):
            return False
        return counted and bool(self._schemas) and bool(self._found)

    def _stamp(self, record: Record) -> tuple[int, int, int] | None:
        data, kind, at, end = record
        if kind != MESSAGE or end - at < 22:
            return None
        number, _, time, _ = struct.unpack_from("<HIQQ", data, at)
        return number, time, at + 22

    def _learn(self, record: Record) -> None:
        data, kind, at, end = record
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
        return Channel(
            number, topic, *self._schemas.get(schema, ("", "", "")), self._counts[number]
        )

    def _chunk(self, record: Record) -> tuple[str, int, int, int, int] | None:
        data, kind, at, end = record
        if kind != CHUNK:
            return None
        _, _, size, checksum = struct.unpack_from("<QQQI", data, at)
        compression, at = _text(data, at + 28, end)
        stop = at + 8 + struct.unpack_from("<Q", data, at)[0]
        if stop > end:
            raise ValueError("a chunk is damaged")
        return compression[:20].decode("utf-8", "replace"), size, checksum, at + 8, stop

    @staticmethod
    def _records(data: Any, at: int, end: int) -> Iterator[Record]:
        """Yield all whole records, up to the end of the file's part with messages."""
        while at + 9 <= end:
            kind, length = struct.unpack_from("<BQ", data, at)
            stop = at + 9 + length
            if kind in (NONE, FOOTER, DATA_END) or stop > end:
                return
            yield data, kind, at + 9, stop
            at = stop


def _text(data: Any, at: int, end: int) -> tuple[bytes, int]:
    """Return a text with its length before it, and where it ends; ValueError if it is longer than
    its record.
    """
    stop = at + 4 + struct.unpack_from("<I", data, at)[0]
    if stop > end:
        raise ValueError("a record is damaged")
    return data[at + 4 : stop], stop


def _counts(data: Any, at: int, end: int) -> dict[int, int]:
    """Return a map of channels to numbers."""
    return dict(struct.iter_unpack("<HQ", _text(data, at, end)[0]))
