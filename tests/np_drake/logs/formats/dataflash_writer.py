"""Writes ArduPilot DataFlash logs for tests: FMT, FMTU and PARM records, then the rows of all
streams by time.
"""

import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from np_drake.logs.formats.format import Stream

CODES = {"B": "B", "Q": "Q", "N": "16s", "n": "4s", "Z": "64s", "f": "f", "d": "d", "g": "e"}
SCALED = {
    "c": ("h", 100),
    "C": ("H", 100),
    "e": ("i", 100),
    "E": ("I", 100),
    "L": ("i", 10_000_000),
}
Definition = tuple[int, str, str, str]  # type, characters, name, columns
FMT = (128, "BBnNZ", "FMT", "Type,Length,Name,Format,Columns")
FMTU = (129, "QBNN", "FMTU", "TimeUS,FmtType,UnitIds,MultIds")
PARM = (130, "QNf", "PARM", "TimeUS,Name,Value")
MSG = (131, "QZ", "MSG", "TimeUS,Message")


def write(
    path: Path,
    streams: Mapping[str, Stream],
    *,
    characters: Mapping[str, str] | None = None,
    parameters: Mapping[str, float] | None = None,
    firmware: str = "ArduCopter V4.5.7 (made)",
) -> None:
    """Write streams named as messages, `NAME` or `NAME.<instance>`; times are since boot [s], kept
    to 1 us.

    characters: of ArduPilot, by column; those not named are written as d (double).
    """
    chosen = characters or {}
    definitions: dict[str, Definition] = {}
    for name, stream in streams.items():
        message, _, instance = name.partition(".")
        columns = ["TimeUS", *(["I"] if instance else []), *stream.columns]
        kinds = "Q" + "B" * bool(instance) + "".join(chosen.get(c, "d") for c in stream.columns)
        definitions.setdefault(message, (132 + len(definitions), kinds, message, ",".join(columns)))
    with path.open("wb") as file:
        for definition in (FMT, FMTU, PARM, MSG, *definitions.values()):
            file.write(_format(definition))
        for message in dict.fromkeys(name.partition(".")[0] for name in streams if "." in name):
            number, kinds, _, _ = definitions[message]
            file.write(
                _record(FMTU, 0, number, "s#".ljust(len(kinds), "-"), "F".ljust(len(kinds), "-"))
            )
        for name, value in (parameters or {}).items():
            file.write(_record(PARM, 0, name, value))
        file.write(_record(MSG, 0, firmware))
        for _, message, values in sorted(_rows(streams), key=lambda row: row[0]):
            file.write(_record(definitions[message], *values))


def _rows(streams: Mapping[str, Stream]) -> Iterator[tuple[float, str, tuple[float, ...]]]:
    for name, stream in streams.items():
        message, _, instance = name.partition(".")
        numbered = (int(instance),) if instance else ()
        columns = (c.tolist() for c in stream.columns.values())
        for t, *values in zip(stream.t.tolist(), *columns, strict=True):
            yield t, message, (round(t * 1e6), *numbered, *values)


def _format(definition: Definition) -> bytes:
    number, kinds, name, columns = definition
    return _record(FMT, number, 3 + struct.calcsize(_struct(kinds)), name, kinds, columns)


def _record(definition: Definition, *values: Any) -> bytes:
    number, kinds = definition[:2]
    stored = [_stored(kind, value) for kind, value in zip(kinds, values, strict=True)]
    return struct.pack("<BBB", 0xA3, 0x95, number) + struct.pack(_struct(kinds), *stored)


def _struct(kinds: str) -> str:
    return "<" + "".join(SCALED[k][0] if k in SCALED else CODES[k] for k in kinds)


def _stored(kind: str, value: Any) -> Any:
    if isinstance(value, str):
        return value.encode()
    return round(value * SCALED[kind][1]) if kind in SCALED else value
