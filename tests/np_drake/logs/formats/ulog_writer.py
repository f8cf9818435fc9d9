"""Writes streams as a PX4 ULog file, as the PX4 user guide documents the format.

Own code: pyulog writes only what it has read.
"""

import re
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from np_drake.logs.formats.format import Stream

MAGIC = b"\x55\x4c\x6f\x67\x01\x12\x35"
START = 500_000  # of a log, since the vehicle's start [us]
INDEXED = re.compile(r"(.+)\[(\d+)\]")
NESTED = re.compile(r"(.+)\[(\d+)\]\.(.+)")


def write(
    path: Path,
    streams: Mapping[str, Stream],
    *,
    facts: Mapping[str, str] | None = None,
    parameters: Mapping[str, float | int] | None = None,
    kinds: Mapping[str, str] | None = None,
) -> None:
    """Write streams; a name like `vehicle_imu.1` is a further instance, columns like `q[0]` become
    arrays.

    Times are those of `timestamp`, to a microsecond.
    kinds: type by column, `double` where it is missing; the column `timestamp_sample` [us since the
        vehicle's start] is uint64.
    """
    kinds = {"timestamp_sample": "uint64_t", **(kinds or {})}
    content = MAGIC + b"\x01" + struct.pack("<Q", START) + message("B", bytes(40))
    content += b"".join(
        message("I", _pair(f"char[{len(v)}] {k}") + v.encode()) for k, v in (facts or {}).items()
    )
    content += b"".join(message("P", _parameter(k, v)) for k, v in (parameters or {}).items())
    formats: dict[str, str] = {}
    for name, stream in streams.items():
        formats |= _formats(name.partition(".")[0], list(stream.columns), kinds)
    content += b"".join(
        message("F", f"{name}:{fields}".encode()) for name, fields in formats.items()
    )
    rows: list[tuple[int, bytes]] = []
    for i, (name, stream) in enumerate(streams.items()):
        base, _, instance = name.partition(".")
        content += message("A", struct.pack("<BH", int(instance or 0), i) + base.encode())
        rows += _rows(i, stream, kinds)
    rows.sort(key=lambda row: row[0])
    path.write_bytes(content + b"".join(row for _, row in rows))


def message(kind: str, payload: bytes) -> bytes:
    """Return a message with its header."""
    return struct.pack("<HB", len(payload), ord(kind)) + payload


def _pair(key: str) -> bytes:
    return struct.pack("<B", len(key)) + key.encode()


def _parameter(name: str, value: float | int) -> bytes:
    kind, letter = ("int32_t", "i") if isinstance(value, int) else ("float", "f")
    return _pair(f"{kind} {name}") + struct.pack(f"<{letter}", value)


def _formats(name: str, columns: Sequence[str], kinds: Mapping[str, str]) -> dict[str, str]:
    """Return the fields of a message and of those in it; columns of an array must stand together,
    in order.
    """
    fields = {"timestamp": "uint64_t"}
    inner: dict[str, list[str]] = {}
    for column in columns:
        if nested := NESTED.fullmatch(column):
            parts = inner.setdefault(nested[1], [])
            parts += [nested[3]] if nested[2] == "0" else []
            fields[nested[1]] = f"{name}_{nested[1]}[{int(nested[2]) + 1}]"
        elif indexed := INDEXED.fullmatch(column):
            fields[indexed[1]] = f"{kinds.get(column, 'double')}[{int(indexed[2]) + 1}]"
        else:
            fields[column] = kinds.get(column, "double")
    found = {
        f"{name}_{array}": "".join(
            f"{kinds.get(f'{array}[0].{part}', 'double')} {part};" for part in parts
        )
        for array, parts in inner.items()
    }
    return {**found, name: "".join(f"{kind} {field};" for field, kind in fields.items())}


TYPES = {
    "double": "<f8",
    "float": "<f4",
    "int32_t": "<i4",
    "uint8_t": "u1",
    "bool": "?",
    "uint64_t": "<u8",
}


def _rows(index: int, stream: Stream, kinds: Mapping[str, str]) -> list[tuple[int, bytes]]:
    """Return time [us] and message of every row."""
    layout = [
        ("id", "<u2"),
        ("t", "<u8"),
        *((c, TYPES[kinds.get(c, "double")]) for c in stream.columns),
    ]
    table = np.zeros(len(stream), np.dtype(layout))
    table["id"] = index
    table["t"] = START + np.round(stream.t * 1e6).astype(np.int64)
    for column, values in stream.columns.items():
        table[column] = values
    size = table.dtype.itemsize
    content = table.tobytes()
    times = table["t"].tolist()
    return [(t, message("D", content[size * i : size * (i + 1)])) for i, t in enumerate(times)]
