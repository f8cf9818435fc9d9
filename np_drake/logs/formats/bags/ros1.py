"""Reads ROS 1 bags, with their index or, as recording leaves them when it is broken off, without.

A record is a header and data, each with its length before it; a chunk holds connections and messages, compressed or
not. With an index only the chunks of the wanted topics are unpacked; without, all records are passed through, from the
first to the last whole one. Source: description of the bag format 2.0.
"""

import itertools
import struct
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from np_drake.logs.errors import LogError
from np_drake.logs.formats.bags.budget import Budget, Channel, MappedBag, Record, unpacked_exactly

MAGIC = b"#ROSBAG V"
START = b"#ROSBAG V2.0\n"
MESSAGE, HEADER, CHUNK, CHUNK_INFO, CONNECTION = b"\x02", b"\x03", b"\x05", b"\x06", b"\x07"  # values of `op`
LONGEST_HEADER = 10**6  # [byte] of a record, own choice
Fields = dict[bytes, bytes]


class Ros1(MappedBag):
    """Channels and messages of a bag, whose index is its end."""

    def __init__(self, path: Path, budget: Budget) -> None:
        """Find all connections and how many messages they have.

        Raises: ValueError: if there is no message; LogError: beyond the budget.
        """
        super().__init__(path, budget)
        if self._bytes[: len(START)] != START:
            raise ValueError("it is no ROS bag of version 2.0")
        self._found: dict[int, tuple[str, str, str, str]] = {}  # topic, type, language, definition
        self.whole = self._read_index()
        if not self.whole:
            self._scan()
        kept = (n for n in self._found if self.whole or self._counts[n])
        self.channels = [Channel(n, *self._found[n], self._counts[n]) for n in kept]
        if not self.channels:
            raise ValueError("no whole message is in it")

    def _stamp(self, record: Record) -> tuple[int, int, int] | None:
        _, fields, at, _ = record
        time, number = fields.get(b"time", b""), fields.get(b"conn", b"")
        if fields.get(b"op") != MESSAGE or len(time) != 8:
            return None
        seconds, nanoseconds = struct.unpack("<II", time)
        return _number(number), seconds * 1_000_000_000 + nanoseconds, at

    def _read_index(self) -> bool:
        """Learn all from the records at the end of the bag; return whether they are there."""
        first = next(_records(self._bytes, len(START)), None)
        if first is None or first[1].get(b"op") != HEADER:
            return False
        header = first[1]
        if header.get(b"encryptor"):
            raise ValueError("it is encrypted")
        start = int.from_bytes(header.get(b"index_pos", b""), "little")
        connections, chunks = 0, 0
        for data, fields, at, end in _records(self._bytes, start) if start >= first[3] else ():
            if fields.get(b"op") == CONNECTION:
                connections += 1
                self._learn(fields, data[at:end])
            elif fields.get(b"op") == CHUNK_INFO:
                chunks += 1
                self._learn_chunk(fields, data[at:end])
        said = _number(header.get(b"conn_count", b"")), _number(header.get(b"chunk_count", b""))
        if connections and (connections, chunks) == said:
            return True
        self._counts.clear()
        self._chunks.clear()
        return False

    def _scan(self) -> None:
        """Learn all by a pass through the bag, up to the first damage."""
        try:
            for data, fields, at, end in self._records(()):
                if fields.get(b"op") == MESSAGE:
                    self._counts[_number(fields.get(b"conn", b""))] += 1
                elif fields.get(b"op") == CONNECTION:
                    self._learn(fields, data[at:end])
        except LogError:
            raise
        except ValueError:
            return

    def _learn(self, fields: Fields, data: bytes) -> None:
        """Take in a connection that is not known yet."""
        from rosbags.typesys.msg import normalize_msgtype

        number = _number(fields.get(b"conn", b""))
        if number in self._found:
            return
        more = _fields(data)
        self._budget.add_channel()
        kind = self._budget.text(more.get(b"type", b"unknown/unknown"))
        topic = self._budget.text(_normal(fields.get(b"topic", b"")))
        definition = self._budget.text(more.get(b"message_definition", b""))
        self._found[number] = topic, normalize_msgtype(kind), "MSG", definition

    def _learn_chunk(self, fields: Fields, data: bytes) -> None:
        """Take in where a chunk begins, and how many messages its connections have in it."""
        counts = dict(struct.iter_unpack("<II", data[: len(data) // 8 * 8]))
        self._counts.update({number: n for number, n in counts.items() if number in self._found})
        self._chunks.append((int.from_bytes(fields.get(b"chunk_pos", b""), "little"), frozenset(counts)))

    def _records(self, wanted: Collection[int]) -> Iterator[Record]:
        take = self._budget.one_pass()
        for record in self._top(frozenset(wanted)):
            data, fields, at, end = record
            if fields.get(b"op") != CHUNK:
                yield record
                continue
            kind, size = fields.get(b"compression", b""), _number(fields.get(b"size", b""))
            if kind == b"none":
                yield from _records(data, at, end)
                continue
            take(size)
            yield from _records(unpacked_exactly(kind[:20].decode("utf-8", "replace"), data[at:end], size), 0)

    def _top(self, wanted: frozenset[int]) -> Iterator[Record]:
        """Yield the records of the file itself; with an index the chunks of the wanted channels alone, each once."""
        if not self._chunks:
            yield from _records(self._bytes, len(START))
        for start in sorted({start for start, has in self._chunks if has & wanted}):
            yield from itertools.islice(_records(self._bytes, start), 1)


def _records(data: Any, at: int, size: int | None = None) -> Iterator[Record]:
    size = len(data) if size is None else size
    while at + 8 <= size:
        body = at + 4 + _number(data[at : at + 4])
        if body + 4 > size:
            return
        end = body + 4 + _number(data[body : body + 4])
        if end > size:
            return
        yield data, _fields(data[at + 4 : body]), body + 4, end
        at = end


def _fields(header: bytes) -> Fields:
    """Return the fields of a header by name; what is damaged is left out, as is all of a header that is too long."""
    fields: Fields = {}
    at = 0 if len(header) <= LONGEST_HEADER else len(header)
    while at + 4 <= len(header):
        end = at + 4 + _number(header[at : at + 4])
        name, _, value = header[at + 4 : end].partition(b"=")
        fields[name] = value
        at = end
    return fields


def _normal(topic: bytes) -> bytes:
    """Return a topic without empty parts."""
    return b"/" * topic.startswith(b"/") + b"/".join(part for part in topic.split(b"/") if part)


def _number(raw: bytes) -> int:
    """Return an unsigned number; 0 where its bytes are not four."""
    return int.from_bytes(raw, "little") if len(raw) == 4 else 0
