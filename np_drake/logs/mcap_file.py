"""MCAP files of JSON messages, each channel with its JSON Schema; readable by Foxglove and PlotJuggler."""

import dataclasses as dc
import heapq
import json
from collections.abc import Iterable
from pathlib import Path

from np_drake.files.atomic_file import atomic_path, plain
from np_drake.logs.errors import LogError
from np_drake.logs.foxglove import Json

Message = tuple[int, Json]  # time [ns], content


@dc.dataclass
class Channel:
    """Messages of one topic in the order of time."""

    topic: str
    schema: Json  # its title is its name
    messages: Iterable[Message]


def require_mcap(path: str | Path) -> None:
    """Check that MCAP files can be written.

    Raises: LogError: if their package is not installed.
    """
    try:
        import mcap.writer  # noqa: F401
    except ImportError as error:
        raise LogError(f"{path}: MCAP needs mcap; pip install 'np_drake[mcap]'.") from error


def write_mcap(path: str | Path, channels: Iterable[Channel]) -> None:
    """Write channels as an MCAP file, whole or not at all; messages stand in the order of time. NaN becomes null.

    Raises: LogError: if the package is not installed; OSError: if the file cannot be written.
    """
    require_mcap(path)
    from mcap.writer import Writer

    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(stream)
        writer.start(library="np_drake")
        streams = [_numbered(writer, channel) for channel in channels]
        sequence: dict[int, int] = {}
        for when, channel, content in heapq.merge(*streams, key=lambda message: message[0]):
            sequence[channel] = sequence.get(channel, -1) + 1
            writer.add_message(channel, when, _encoded(content), when, sequence[channel])
        writer.finish()


def _numbered(writer, channel: Channel) -> Iterable[tuple[int, int, Json]]:
    """Return the messages of a channel with its number in the file, after adding it there."""
    schema = writer.register_schema(channel.schema["title"], "jsonschema", _encoded(channel.schema))
    number = writer.register_channel(channel.topic, "json", schema)
    return [(when, number, content) for when, content in channel.messages]


def _encoded(content: Json) -> bytes:
    return json.dumps(plain(content), separators=(",", ":"), allow_nan=False).encode()
