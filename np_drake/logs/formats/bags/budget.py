"""What a bag may ask of its reader: bytes that it unpacks to, text of its topics.

A chunk is decompressed only where what it claims is within the budgets, and never beyond its claim.
"""

import bz2
import dataclasses as dc
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

from np_drake.files.input_file import block_budget, size_of, text_budget
from np_drake.logs.errors import LogError

# Budgets, own choice.
MOST_TEXT = (
    5 * 10**6
)  # characters of all different names and definitions; parsing takes 20 bytes each
LEAST_CHANNELS = 20_000  # that any bag may have
BYTES_A_CHANNEL = 100  # of a bag for every further one; its records take more


@dc.dataclass(frozen=True)
class Channel:
    """One topic in one file: its number there, the type of its messages and its definition, how
    many there are.

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
            f"{self._bag}: must hold chunks and messages that unpack to "
            f"{_megabytes(self.block)}. {_REMEDY}"
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
            raise LogError(
                f"{self._bag}: must not hold as many topics as it does. Is it the right file?"
            )


def unpacked(kind: str, data: bytes, most: int) -> bytes:
    """Return the decompressed data, or its first `most` + 1 bytes where it is larger.

    Args:
        kind: `bz2`, `lz4` or `zstd`.
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
    """Return the decompressed data of a chunk that claims a size, which was taken from the budget
    before.

    Args:
        kind: `bz2`, `lz4` or `zstd`.
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


_REMEDY = (
    "If it is right, write it without compression (`rosbag decompress`, `mcap "
    "decompress`, `ros2 bag convert`)."
)
