"""A bag mapped into memory: its records, those of chunks in place of them, with its index or
without.
"""

import abc
import itertools
import mmap
import struct
import zlib
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from np_drake.logs.errors import LogError
from np_drake.logs.formats.bags.budget import Budget, Channel, unpacked_exactly

Record = tuple[
    Any, Any, int, int
]  # data in which it lies, its header or kind, start and end of its content


class MappedBag(abc.ABC):
    """Channels and messages of a file of records, mapped into memory.

    whole: its end is there. Where that holds an index, only the chunks of the wanted channels are
    unpacked; without, all records are passed through, from the first to the last whole one.
    """

    _start: int  # where the records begin

    def __init__(self, path: Path, budget: Budget) -> None:
        """Find all channels and how many messages they have.
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
        """Yield the records of the file itself; with an index the chunks of the wanted channels
        alone, each once.
        """
        if not self._chunks:
            yield from self._records(self._bytes, self._start, len(self._bytes))
        for start in sorted({start for start, has in self._chunks if not has or has & wanted}):
            yield from itertools.islice(self._records(self._bytes, start, len(self._bytes)), 1)

    @abc.abstractmethod
    def _read_index(self) -> tuple[bool, bool]:
        """Learn all from the end of the file; return whether that is there, and whether it says
        enough.
        """

    @staticmethod
    @abc.abstractmethod
    def _records(data: Any, at: int, end: int) -> Iterator[Record]:
        """Yield all whole records of the data from `at` to `end`."""

    @abc.abstractmethod
    def _stamp(self, record: Record) -> tuple[int, int, int] | None:
        """Return channel, time of receipt [ns] and start of a message; None for any other
        record.
        """

    @abc.abstractmethod
    def _chunk(self, record: Record) -> tuple[str, int, int, int, int] | None:
        """Return compression, size, checksum, start and end of a chunk's records; None for any
        other record.
        """

    @abc.abstractmethod
    def _learn(self, record: Record) -> None:
        """Take in a channel that is not known yet; nothing of any other record."""

    @abc.abstractmethod
    def _channel(self, number: int) -> Channel:
        """Return a channel that was found."""
