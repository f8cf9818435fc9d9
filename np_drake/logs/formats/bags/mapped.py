"""Bag whose file is mapped into memory, and whose messages are read record by record."""

import mmap
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from np_drake.logs.formats.bags.budget import Budget, Channel

Record = tuple[Any, Any, int, int]  # data in which it lies, its header or kind, start and end of its content


class MappedBag:
    """Channels and messages of a file of records. whole: its end is there."""

    channels: list[Channel]
    whole: bool

    def __init__(self, path: Path, budget: Budget) -> None:
        """Map the file.

        Raises: ValueError: if it is empty.
        """
        with path.open("rb") as file:
            self._bytes = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self._budget = budget
        self._counts: Counter[int] = Counter()  # messages by channel
        self._chunks: list[tuple[int, frozenset[int]]] = []  # start of the record, channels in it

    def messages(self, channels: Collection[Channel]) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield channel, time of receipt [ns] and bytes of the messages, as they lie in the file.

        Raises: ValueError: at a damaged chunk; LogError: beyond the budget.
        """
        wanted = {c.number: c for c in channels}
        for record in self._records(wanted.keys()):
            stamp = self._stamp(record)
            if stamp is not None and stamp[0] in wanted:
                number, time, start = stamp
                yield wanted[number], time, record[0][start : record[3]]

    def close(self) -> None:
        """Close the file."""
        self._bytes.close()

    def _records(self, wanted: Collection[int]) -> Iterator[Record]:
        """Yield the records of the file, those of chunks in place of them."""
        raise NotImplementedError

    def _stamp(self, record: Record) -> tuple[int, int, int] | None:
        """Return channel, time of receipt [ns] and start of a message; None for any other record."""
        raise NotImplementedError
