"""A bag mapped into memory, and what it may ask of its reader: bytes that it unpacks to, text of its topics.

A chunk is decompressed only where what it claims is within the budgets, and never beyond its claim.
"""

import abc
import bz2
import dataclasses as dc
import functools
import itertools
import mmap
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

from np_drake.files.input_file import block_budget, size_of, text_budget
from np_drake.logs.errors import LogError

# Budgets, own choice.
MOST_TEXT = 5 * 10**6  # characters of all different names and definitions; parsing takes 20 bytes each
LEAST_CHANNELS = 20_000  # that any bag may have
BYTES_A_CHANNEL = 100  # of a bag for every further one; its records take more


@dc.dataclass(frozen=True)
class Channel:
    """One topic in one file: its number there, the type of its messages and its definition, how many there are.

    language: of the definition, `MSG` or `IDL`; empty where there is none.
    """

    number: int
    topic: str
    type: str
    language: str
    definition: str
    count: int


class Budget:
    """What the files of a bag may take together."""

    def __init__(self, bag: Path) -> None:
        """Begin with nothing taken."""
        self._bag = bag
        self.block = block_budget(bag)
        self._texts: dict[str, str] = {}
        self._text_left = MOST_TEXT
        self._channels_left = LEAST_CHANNELS + size_of(bag) // BYTES_A_CHANNEL

    def one_pass(self) -> Callable[[int], None]:
        """Return the function that takes bytes to unpack, in one pass through a file.

        It raises LogError: beyond the budget of a block, or of the bag.
        """
        left = most = text_budget(self._bag)

        def take(size: int) -> None:
            nonlocal left
            left -= size
            if size > self.block:
                raise self.too_large_block()
            if left < 0:
                raise LogError(f"{self._bag}: must unpack to {_megabytes(most)}. {_REMEDY}")

        return take

    def too_large_block(self) -> LogError:
        """Return the error of a chunk or message beyond its budget."""
        return LogError(
            f"{self._bag}: must hold chunks and messages that unpack to {_megabytes(self.block)}. {_REMEDY}"
        )

    def text(self, raw: bytes) -> str:
        """Return a name or definition; one object for all that are equal.

        Raises: LogError: if all different ones together are too long.
        """
        text = raw.decode("utf-8", "replace")
        if text not in self._texts:
            self._text_left -= len(text)
            if self._text_left < 0:
                most = f"{MOST_TEXT / 1e6:g} million characters"
                raise LogError(
                    f"{self._bag}: must name and define its topics in {most}. Is it the right file?"
                )
            self._texts[text] = text
        return self._texts[text]

    def add_channel(self) -> None:
        """Take one channel.

        Raises: LogError: if there are too many.
        """
        self._channels_left -= 1
        if self._channels_left < 0:
            raise LogError(f"{self._bag}: must not hold as many topics as it does. Is it the right file?")


def unpacked(kind: str, data: bytes, most: int) -> bytes:
    """Return the decompressed data, or its first `most` + 1 bytes where it is larger.

    Args:
        kind: `bz2`, `lz4` or `zstd`.
        data: compressed.
        most: size that is allowed [byte].
    Raises: ValueError: if it is damaged, or of another kind.
    """
    decompressor = _decompressor(kind)
    try:
        content = decompressor.decompress(data, most + 1)
    except Exception as error:  # every library has its own
        raise ValueError(f"a chunk is damaged ({error})") from error
    if not decompressor.eof and len(content) <= most:
        raise ValueError("a chunk is cut off")
    return bytes(content)


def unpacked_exactly(kind: str, data: bytes, size: int) -> bytes:
    """Return the decompressed data of a chunk that claims a size, which was taken from the budget before.

    Args:
        kind: `bz2`, `lz4` or `zstd`.
        data: compressed.
        size: that it claims [byte].
    Raises: ValueError: if it is damaged, or of another size.
    """
    content = unpacked(kind, data, size)
    if len(content) != size:
        raise ValueError("a chunk is not of the size that it claims")
    return content


def _decompressor(kind: str) -> Any:
    if kind == "bz2":
        return bz2.BZ2Decompressor()
    if kind == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        return LZ4FrameDecompressor()
    if kind == "zstd":
        return zstd().ZstdDecompressor()
    raise ValueError(f"the compression {kind[:20]!r} is not known")


@functools.cache
def zstd() -> Any:
    """Return the module for zstd that rosbags brings; from Python 3.14 on it is Python's own."""
    try:
        from compression import zstd as module  # type: ignore[import-not-found,unused-ignore]
    except ImportError:
        from backports import zstd as module
    return module


def _megabytes(size: int) -> str:
    return f"at most {size / 1e6:.0f} MB for the size of its file"


_REMEDY = "If it is right, write it without compression (`rosbag decompress`, `mcap decompress`, `ros2 bag convert`)."


Record = tuple[Any, Any, int, int]  # data in which it lies, its header or kind, start and end of its content


class MappedBag(abc.ABC):
    """Channels and messages of a file of records, mapped into memory.

    whole: its end is there. Where that holds an index, only the chunks of the wanted channels are unpacked; without,
    all records are passed through, from the first to the last whole one.
    """

    _start: int  # where the records begin

    def __init__(self, path: Path, budget: Budget) -> None:
        """Find all channels and how many messages they have.

        Args:
            path: of the file.
            budget: of its bag.
        Raises: ValueError: if there is no message; LogError: beyond the budget.
        """
        with path.open("rb") as file:
            self._bytes = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self._budget = budget
        self._counts: Counter[int] = Counter()  # messages by channel
        self._chunks: list[tuple[int, frozenset[int]]] = []  # start of the record, channels in it
        self._found: dict[int, Any] = {}  # what is known of each channel
        self.whole, indexed = self._read_index()
        if not indexed:
            self._counts.clear()
            self._chunks.clear()
            self._scan()
        self.channels = [self._channel(n) for n in self._found if self.whole or self._counts[n]]
        if not self.channels:
            raise ValueError("no whole message is in it")

    def messages(self, channels: Collection[Channel]) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield channel, time of receipt [ns] and bytes of the messages, as they lie in the file.

        Raises: ValueError: at a damaged chunk; LogError: beyond the budget.
        """
        wanted = {c.number: c for c in channels}
        for record in self._unpacked(wanted.keys()):
            stamp = self._stamp(record)
            if stamp is not None and stamp[0] in wanted:
                number, time, start = stamp
                yield wanted[number], time, record[0][start : record[3]]

    def close(self) -> None:
        """Close the file."""
        self._bytes.close()

    def _scan(self) -> None:
        """Learn all by a pass through the file, up to the first damage."""
        try:
            for record in self._unpacked(()):
                stamp = self._stamp(record)
                if stamp is None:
                    self._learn(record)
                else:
                    self._counts[stamp[0]] += 1
        except LogError:
            raise
        except (ValueError, struct.error):
            return

    def _unpacked(self, wanted: Collection[int]) -> Iterator[Record]:
        """Yield the records of the file, those of chunks in place of them."""
        take = self._budget.one_pass()
        for record in self._top(frozenset(wanted)):
            chunk = self._chunk(record)
            if chunk is None:
                yield record
                continue
            data, (kind, size, checksum, at, end) = record[0], chunk
            if kind:
                take(size)
                data, at, end = unpacked_exactly(kind, data[at:end], size), 0, size
                if checksum and zlib.crc32(data) != checksum:
                    raise ValueError("the checksum of a chunk is wrong")
            yield from self._records(data, at, end)

    def _top(self, wanted: frozenset[int]) -> Iterator[Record]:
        """Yield the records of the file itself; with an index the chunks of the wanted channels alone, each once."""
        if not self._chunks:
            yield from self._records(self._bytes, self._start, len(self._bytes))
        for start in sorted({start for start, has in self._chunks if not has or has & wanted}):
            yield from itertools.islice(self._records(self._bytes, start, len(self._bytes)), 1)

    @abc.abstractmethod
    def _read_index(self) -> tuple[bool, bool]:
        """Learn all from the end of the file; return whether that is there, and whether it says enough."""

    @staticmethod
    @abc.abstractmethod
    def _records(data: Any, at: int, end: int) -> Iterator[Record]:
        """Yield all whole records of the data from `at` to `end`."""

    @abc.abstractmethod
    def _stamp(self, record: Record) -> tuple[int, int, int] | None:
        """Return channel, time of receipt [ns] and start of a message; None for any other record."""

    @abc.abstractmethod
    def _chunk(self, record: Record) -> tuple[str, int, int, int, int] | None:
        """Return compression, size, checksum, start and end of a chunk's records; None for any other record."""

    @abc.abstractmethod
    def _learn(self, record: Record) -> None:
        """Take in a channel that is not known yet; nothing of any other record."""

    @abc.abstractmethod
    def _channel(self, number: int) -> Channel:
        """Return a channel that was found."""
