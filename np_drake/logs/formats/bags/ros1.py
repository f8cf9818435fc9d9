"""Reads ROS 1 bags, with their index or, as recording leaves them when it is broken off, without.

A record is a header and data, each with its length before it; a chunk holds connections and
messages, compressed or not. Source: description of the bag format 2.0.
"""

import struct
from collections.abc import Iterator
from typing import Any

from np_drake.logs.formats.bags.budget import Channel
from np_drake.logs.formats.bags.mapped_bag import MappedBag, Record

MAGIC = b"#ROSBAG V"
START = b"#ROSBAG V2.0\n"
MESSAGE, HEADER, CHUNK, CHUNK_INFO, CONNECTION = (
    b"\x02",
    b"\x03",
    b"\x05",
    b"\x06",
    b"\x07",
)  # values of `op`
LONGEST_HEADER = 10**6  # [byte] of a record, own choice
Fields = dict[bytes, bytes]


class Ros1(MappedBag):
    """Channels and messages of a bag, whose index is its end."""

    _start = len(START)

    def _read_index(self) -> tuple[bool, bool]:
        if self._bytes[: len(START)] != START:
            raise ValueError("it is no ROS bag of version 2.0")
        first = next(self._records(self._bytes, len(START), len(self._bytes)), None)
        if first is None or first[1].get(b"op") != HEADER:
            return False, False
        header = first[1]
        if header.get(b"encryptor"):
            raise ValueError("it is encrypted")
        start = int.from_bytes(header.get(b"index_pos", b""), "little")
        connections, chunks = 0, 0
        for record in (
            self._records(self._bytes, start, len(self._bytes)) if start >= first[3] else ()
        ):
            data, fields, at, end = record
            connections += fields.get(b"op") == CONNECTION
            self._learn(record)
            if fields.get(b"op") == CHUNK_INFO:
                chunks += 1
                counts = dict(struct.iter_unpack("<II", data[at:end][: (end - at) // 8 * 8]))
                self._counts.update(
                    {number: n for number, n in counts.items() if number in self._found}
                )
                place = int.from_bytes(fields.get(b"chunk_pos", b""), "little")
                self._chunks.append((place, frozenset(counts)))
        said = _number(header.get(b"conn_count", b"")), _number(header.get(b"chunk_count", b""))
        indexed = bool(connections) and (connections, chunks) == said
        return indexed, indexed

    def _stamp(self, record: Record) -> tuple[int, int, int] | None:
        _, fields, at, _ = record
        time, number = fields.get(b"time", b""), fields.get(b"conn", b"")
        if fields.get(b"op") != MESSAGE or len(time) != 8:
            return None
        seconds, nanoseconds = struct.unpack("<II", time)
        return _number(number), seconds * 1_000_000_000 + nanoseconds, at

    def _learn(self, record: Record) -> None:
        data, fields, at, end = record
        number = _number(fields.get(b"conn", b""))
        if fields.get(b"op") != CONNECTION or number in self._found:
            return
        from rosbags.typesys.msg import normalize_msgtype

        more = _fields(data[at:end])
        self._budget.add_channel()
        kind = self._budget.text(more.get(b"type", b"unknown/unknown"))
        topic = self._budget.text(_normal(fields.get(b"topic", b"")))
        definition = self._budget.text(more.get(b"message_definition", b""))
        self._found[number] = topic, normalize_msgtype(kind), "MSG", definition

    def _channel(self, number: int) -> Channel:
        topic, kind, language, definition = self._found[number]
        return Channel(number, topic, kind, language, definition, self._counts[number])

    def _chunk(self, record: Record) -> tuple[str, int, int, int, int] | None:
        _, fields, at, end = record
        if fields.get(b"op") != CHUNK:
            return None
        kind = fields.get(b"compression", b"")
        compression = "" if kind == b"none" else kind[:20].decode("utf-8", "replace") or "none"
        return compression, _number(fields.get(b"size", b"")), 0, at, end

    @staticmethod
    def _records(data: Any, at: int, end: int) -> Iterator[Record]:
        while at + 8 <= end:
            body = at + 4 + _number(data[at : at + 4])
            if body + 4 > end:
                return
            stop = body + 4 + _number(data[body : body + 4])
            if stop > end:
                return
            yield data, _fields(data[at + 4 : body]), body + 4, stop
            at = stop


def _fields(header: bytes) -> Fields:
    """Return the fields of a header by name; what is damaged is left out, as is all of a header
    that is too long.
    """
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
