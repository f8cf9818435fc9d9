"""Reads a ROS 1 bag that has no whole index, as recording leaves it when it is broken off.

It passes through the records from the first to the last whole one. A record is a header and data, each with its length
before it; a chunk holds connections and messages, compressed or not. Source: description of the bag format 2.0.
"""

import bz2
import mmap
import struct
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

START = b"#ROSBAG V2.0\n"
MESSAGE, CHUNK, CONNECTION = b"\x02", b"\x05", b"\x07"  # values of `op`
Record = tuple[
    dict[bytes, bytes], Any, int, int
]  # fields of the header; where the data lie: in what, from, to


class Ros1Scan:
    """Connections and messages of a bag, with the methods of the readers of rosbags that are used here."""

    def __init__(self, path: Path) -> None:
        """Find all connections and count their messages.

        Raises: ValueError: if there is no message.
        """
        with path.open("rb") as file:
            self.bytes = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        if self.bytes[: len(START)] != START:
            raise ValueError("it is no ROS bag of version 2.0")
        found: dict[int, Any] = {}
        counts: Counter[int] = Counter()
        for fields, data, at, end in self._records():
            number = _number(fields.get(b"conn", b""))
            if fields.get(b"op") == MESSAGE:
                counts[number] += 1
            elif fields.get(b"op") == CONNECTION and number not in found:
                found[number] = _connection(number, fields, _fields(data[at:end]), self)
        self.connections = [c._replace(msgcount=counts[n]) for n, c in found.items() if counts[n]]
        if not self.connections:
            raise ValueError("no whole message is in it")

    def messages(self, connections: Collection[Any]) -> Iterator[tuple[Any, int, bytes]]:
        """Yield connection, time of receipt [ns] and bytes of the messages, as they lie in the bag."""
        wanted = {c.id: c for c in connections}
        for fields, data, at, end in self._records():
            connection = wanted.get(_number(fields.get(b"conn", b"")))
            time = fields.get(b"time", b"")
            if connection and fields.get(b"op") == MESSAGE and len(time) == 8:
                seconds, nanoseconds = struct.unpack("<II", time)
                yield connection, seconds * 1_000_000_000 + nanoseconds, data[at:end]

    def close(self) -> None:
        """Close the file."""
        self.bytes.close()

    def _records(self) -> Iterator[Record]:
        """Yield the records of the file, and of its chunks in place of them; damaged chunks are left out."""
        for record in _records(self.bytes, len(START)):
            fields, data, at, end = record
            if fields.get(b"op") == CHUNK:
                yield from _records(_decompress(data[at:end], fields), 0)
            else:
                yield record


def _records(data: Any, at: int) -> Iterator[Record]:
    size = len(data)
    while at + 8 <= size:
        body = at + 4 + _number(data[at : at + 4])
        if body + 4 > size:
            return
        end = body + 4 + _number(data[body : body + 4])
        if end > size:
            return
        yield _fields(data[at + 4 : body]), data, body + 4, end
        at = end


def _fields(header: bytes) -> dict[bytes, bytes]:
    """Return the fields of a header by name; what is damaged is left out."""
    fields, at = {}, 0
    while at + 4 <= len(header):
        end = at + 4 + _number(header[at : at + 4])
        name, _, value = header[at + 4 : end].partition(b"=")
        fields[name] = value
        at = end
    return fields


def _decompress(data: bytes, fields: dict[bytes, bytes]) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

    kind, size = fields.get(b"compression"), _number(fields.get(b"size", b""))
    try:
        if kind == b"bz2":
            return bz2.BZ2Decompressor().decompress(data, size)
        if kind == b"lz4":
            return LZ4FrameDecompressor().decompress(data, size)
    except (OSError, RuntimeError, EOFError):
        return b""
    return data if kind == b"none" else b""


def _connection(number: int, fields: dict[bytes, bytes], more: dict[bytes, bytes], owner: Ros1Scan) -> Any:
    from rosbags.interfaces import (
        Connection,
        ConnectionExtRosbag1,
        MessageDefinition,
        MessageDefinitionFormat,
    )
    from rosbags.typesys.msg import normalize_msgtype

    text = {k: v.decode("utf-8", "replace") for k, v in {**more, b"topic": fields.get(b"topic", b"")}.items()}
    definition = MessageDefinition(MessageDefinitionFormat.MSG, text.get(b"message_definition", ""))
    kind = normalize_msgtype(text.get(b"type", "unknown/unknown"))
    return Connection(
        number, text[b"topic"], kind, definition, "", 0, ConnectionExtRosbag1(None, None), owner
    )


def _number(raw: bytes) -> int:
    """Return an unsigned number; 0 where its bytes are not four."""
    return int.from_bytes(raw, "little") if len(raw) == 4 else 0
