"""Numbers of serialised ROS messages, by where they lie in the bytes.

Messages of one topic mostly differ in their numbers alone: strings and sequences have the same
lengths. The fields are then at the same places, and one call of `struct` reads those that are
wanted. `find_fields` finds the places in a message; `Decoder` does so once for every layout that it
meets.

Source: serialisation of ROS 1 messages (packed, little-endian); plain CDR of the OMG (DDS-RTPS) for
ROS 2: a header of 4 bytes, then every number on a multiple of its size. Type definitions are those
of rosbags' type stores.
"""

import dataclasses as dc
import math
import operator
import struct
from collections.abc import Callable, Mapping
from typing import Any

# `fielddefs` of rosbags: constants and fields by type.
Types = Mapping[str, tuple[Any, list[tuple[str, Any]]]]
BASE, NAME, ARRAY, SEQUENCE = 1, 2, 3, 4  # kinds of fields in them
CODES = {  # of `struct`
    **{
        "bool": "?",
        "byte": "B",
        "char": "B",
        "int8": "b",
        "uint8": "B",
        "int16": "h",
        "uint16": "H",
    },
    **{"int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d"},
}
LONGEST = 32  # elements of an array that become columns
MOST_PARTS = 100_000  # messages, texts and sequences within a message; more are damage
MOST_NUMBERS = 10_000  # of a message that become columns; further ones are left out
MOST_LAYOUTS = 256  # that are remembered
MOST_PLACES = 300_000  # numbers and lengths of all remembered layouts together
STAMP = ("header.stamp.sec", "header.stamp.nanosec")
PADDING = "structure_needs_at_least_one_member"  # of empty types in ROS 2


@dc.dataclass
class Fields:
    """Places in a message: of numbers by dotted path, and of the lengths that the layout depends
    on.
    """

    order: str  # of bytes, of `struct`
    numbers: dict[str, tuple[int, str]] = dc.field(default_factory=dict)  # offset, code of `struct`
    lengths: dict[int, int] = dc.field(default_factory=dict)  # value by offset

    @property
    def columns(self) -> tuple[str, ...]:
        """Paths of the numbers without those of the header."""
        return tuple(p for p in self.numbers if not p.startswith("header."))


def find_fields(raw: bytes, types: Types, name: str, *, ros1: bool) -> Fields:
    """Return the fields of a message of a type.

    Arrays longer than `LONGEST`, covariances and numbers beyond `MOST_NUMBERS` are left out.

    Args:
        ros1: whether it is serialised as ROS 1 does.
    Raises: ValueError: if the bytes are no message of the type.
    """
    return _Walk(raw, types, ros1).fields_of(name)


def missing_types(types: Types, name: str) -> list[str]:
    """Return the names of the types that a type needs and that are not defined."""
    needed = [name]  # grows below
    seen = {name}
    for known in needed:
        for _, (kind, what) in types[known][1] if known in types else ():
            inner = what[0] if kind in (ARRAY, SEQUENCE) else (kind, what)
            if inner[0] == NAME and inner[1] not in seen:
                seen.add(inner[1])
                needed.append(inner[1])
    return [n for n in needed if n not in types]


class Decoder:
    """Reads the wanted numbers of the messages of a topic.

    Args:
        ros1: whether messages are serialised as ROS 1 does.
    """

    def __init__(self, types: Types, name: str, wanted: list[str], *, ros1: bool) -> None:
        self.types, self.name, self.wanted, self.ros1 = types, name, wanted, ros1
        self.layouts: dict[tuple[int, bytes], list[_Layout]] = {}
        self.places = 0  # in them

    def __call__(self, raw: bytes) -> tuple[float, ...]:
        """Return seconds and nanoseconds of the stamp (0 without), then the wanted numbers (NaN
        where not there).

        Raises: ValueError: if the bytes are no message of the type.
        """
        key = len(raw), b"" if self.ros1 else raw[:2]
        for layout in self.layouts.get(key, ()):
            if layout.lengths(raw) == layout.expected:
                return layout.pick((*layout.numbers(raw), math.nan, 0))
        layout = self._learn(raw)
        self.places += len(layout.expected) + len(self.wanted)
        if sum(map(len, self.layouts.values())) >= MOST_LAYOUTS or self.places > MOST_PLACES:
            self.layouts.clear()
            self.places = len(layout.expected) + len(self.wanted)
        self.layouts.setdefault(key, []).append(layout)
        return layout.pick((*layout.numbers(raw), math.nan, 0))

    def _learn(self, raw: bytes) -> "_Layout":
        fields = find_fields(raw, self.types, self.name, ros1=self.ros1)
        stamp = [p for p in STAMP if fields.numbers.get(p, (0, ""))[1] in ("i", "I")]
        stamp = stamp if len(stamp) == len(STAMP) else []
        paths = [p for p in fields.numbers if p in {*stamp, *self.wanted}]
        places = {p: i for i, p in enumerate(paths)}
        nan, zero = len(paths), len(paths) + 1
        picks = [places.get(p, zero) for p in STAMP] + [places.get(p, nan) for p in self.wanted]
        lengths = [(at, "I") for at in fields.lengths]
        return _Layout(
            _unpacker(fields.order, lengths),
            tuple(fields.lengths.values()),
            _unpacker(fields.order, [fields.numbers[p] for p in paths]),
            operator.itemgetter(*picks),
        )


@dc.dataclass
class _Layout:
    lengths: Callable[[bytes], tuple[int, ...]]
    expected: tuple[int, ...]
    numbers: Callable[[bytes], tuple[float, ...]]
    pick: Callable[[tuple[float, ...]], tuple[float, ...]]


def _unpacker(order: str, places: list[tuple[int, str]]) -> Callable[[bytes], tuple[Any, ...]]:
    """Return the function that reads numbers at increasing offsets."""
    code, end = order, 0
    for at, kind in places:
        code += f"{at - end}x{kind}"
        end = at + struct.calcsize(f"={kind}")
    return struct.Struct(code).unpack_from


class _Walk:
    """Passes through a message from its first byte to its last."""

    def __init__(self, raw: bytes, types: Types, ros1: bool) -> None:
        self.raw, self.types, self.ros1 = raw, types, ros1
        self.start = 0 if ros1 else 4
        if not ros1 and (len(raw) < 4 or raw[0] != 0 or raw[1] not in (0, 1)):
            raise ValueError("the message is not in plain CDR")
        self.at = self.start
        self.parts = 0
        self.fields = Fields("<" if ros1 or raw[1] == 1 else ">")

    def fields_of(self, name: str) -> Fields:
        self._message(name, "", True)
        return self.fields

    def _message(self, name: str, path: str, keep: bool) -> None:
        self._count_part()
        if path.count(".") > 20:
            raise ValueError("the message has too many parts")
        if name not in self.types:
            raise ValueError(f"the type {name} is not defined")
        for field, kind in self.types[name][1]:
            if field != PADDING or not self.ros1:
                self._field(
                    kind, path + field, keep and "covariance" not in field and field != PADDING
                )

    def _field(self, kind: tuple[int, Any], path: str, keep: bool) -> None:
        node, what = kind
        if node == BASE and what[0] == "string":
            self._advance(self._length())
        elif node == BASE:
            self._numbers(what[0], [path] if keep else [], 1)
        elif node == NAME:
            self._message(what, f"{path}.", keep)
        else:
            inner, count = what
            count = self._length() if node == SEQUENCE else count
            self._items(inner, count, path, keep and count <= LONGEST)

    def _items(self, inner: tuple[int, Any], count: int, path: str, keep: bool) -> None:
        if count > len(self.raw):
            raise ValueError("an array is longer than the message")
        paths = [f"{path}[{i}]" for i in range(count)] if keep else []
        if inner[0] == BASE and inner[1][0] != "string":
            self._numbers(inner[1][0], paths, count)
            return
        for i in range(count):
            self._field(inner, paths[i] if keep else path, keep)

    def _numbers(self, name: str, paths: list[str], count: int) -> None:
        if name not in CODES:
            raise ValueError(f"the type {name} is not known")
        if not count:
            return
        size = struct.calcsize(f"={CODES[name]}")
        self._align(size)
        at = self.at
        self._advance(size * count)
        if len(self.fields.numbers) + len(paths) <= MOST_NUMBERS:
            self.fields.numbers.update(
                (p, (at + i * size, CODES[name])) for i, p in enumerate(paths)
            )

    def _count_part(self) -> None:
        self.parts += 1
        if self.parts > MOST_PARTS:
            raise ValueError("the message has too many parts")

    def _length(self) -> int:
        self._count_part()
        self._align(4)
        at = self.at
        self._advance(4)
        (length,) = struct.unpack_from(f"{self.fields.order}I", self.raw, at)
        self.fields.lengths[at] = length
        return length

    def _align(self, size: int) -> None:
        if not self.ros1:
            self.at += (self.start - self.at) % size

    def _advance(self, size: int) -> None:
        self.at += size
        if self.at > len(self.raw):
            raise ValueError("the message is cut off")
