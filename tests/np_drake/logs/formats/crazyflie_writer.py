"""Writes streams as a Crazyflie usd-log, as Bitcraze documents the format."""

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from np_drake.logs.formats.format import Stream

TIMES = {
    1: ("I", 1e3),
    2: ("Q", 1e6),
}  # by version: type of a record's time, and its units in a second
FIRST_ID = 7


def write(
    path: Path,
    streams: Mapping[str, Stream],
    *,
    version: int = 2,
    kinds: Mapping[str, str] | None = None,
) -> None:
    """Write every stream as an event type, records in the order of time.

    kinds: letter of `struct` by column; `f` where it is missing.
    """
    path.write_bytes(encode(streams, version=version, kinds=kinds))


def encode(
    streams: Mapping[str, Stream], *, version: int = 2, kinds: Mapping[str, str] | None = None
) -> bytes:
    """Return the bytes of a whole log."""
    content = header(streams, version=version, kinds=kinds)
    records = [
        r for i, s in enumerate(streams.values()) for r in _records(i, s, version, kinds or {})
    ]
    records.sort(key=lambda record: record[0])
    content += b"".join(record for _, record in records)
    return content + struct.pack("<I", zlib.crc32(content))


def header(
    streams: Mapping[str, Stream], *, version: int = 2, kinds: Mapping[str, str] | None = None
) -> bytes:
    """Return the bytes before the first record."""
    content = struct.pack("<BHH", 0xBC, version, len(streams))
    for i, (name, stream) in enumerate(streams.items()):
        content += struct.pack("<H", FIRST_ID + i) + name.encode() + b"\0"
        content += struct.pack("<H", len(stream.columns))
        for column in stream.columns:
            content += f"{column}({(kinds or {}).get(column, 'f')})".encode() + b"\0"
    return content


def _records(
    index: int, stream: Stream, version: int, kinds: Mapping[str, str]
) -> list[tuple[float, bytes]]:
    """Return time and bytes of every record of one stream."""
    letter, units = TIMES[version]
    letters = [kinds.get(column, "f") for column in stream.columns]
    layout = struct.Struct(f"<H{letter}{''.join(letters)}")
    columns = [
        c.tolist()
        if k in "fde"
        else c.astype(bool if k == "?" else np.int64 if k != "Q" else np.uint64).tolist()
        for k, c in zip(letters, stream.columns.values(), strict=True)
    ]
    ticks = np.round(stream.t * units).astype(np.int64).tolist()
    rows = zip(*columns, strict=True) if columns else [()] * len(ticks)
    return [
        (tick, layout.pack(FIRST_ID + index, tick, *row))
        for tick, row in zip(ticks, rows, strict=True)
    ]
