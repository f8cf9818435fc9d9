"""Recording of a flight as its format holds it: streams of named columns, each with its own times."""

import dataclasses as dc
import difflib
from collections.abc import Callable, Collection, Iterator, Mapping

import numpy as np

from np_drake.logs.errors import LogError

Progress = Callable[[float], None]  # called with the share of a file that is read [1]
Contents = Mapping[str, tuple[str, ...]]  # names of the columns of every stream


@dc.dataclass(frozen=True)
class Stream:
    """Columns (n,) of one source, sampled together at t (n,) [s], in the units of the file.

    Times are those of the file, on one clock for all streams of a recording. They may repeat, run back or have gaps.
    """

    t: np.ndarray
    columns: Mapping[str, np.ndarray]

    def __len__(self) -> int:
        return len(self.t)


@dc.dataclass(frozen=True)
class Recording:
    """Streams of one file by name.

    path: of the file, for messages.   format: name of its format.   facts: what its header says (vehicle, firmware,
    parameters), for the sheet.   notes: what the decoder left out or mended, one line each.
    """

    path: str
    format: str
    streams: Mapping[str, Stream]
    facts: Mapping[str, str] = dc.field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def contents(self) -> Contents:
        """Names of the columns of every stream."""
        return {name: tuple(stream.columns) for name, stream in self.streams.items()}


def find_column(contents: Contents, name: str, path: str = "log") -> tuple[str, str]:
    """Return stream and column that a name means: `stream/column`, or a column's name where one stream alone has it.

    Raises: LogError: if no stream has such a column, or several have; the nearest names are in the message.
    """
    stream, found, column = name.rpartition("/")
    if found and column in contents.get(stream, ()):
        return stream, column
    holders = [s for s, columns in contents.items() if name in columns]
    if len(holders) == 1:
        return holders[0], name
    if holders:
        wanted = ", ".join(f"{s}/{name}" for s in holders)
        raise LogError(f"{path}, column {name}: several streams have it; name one of {wanted} in the map.")
    near = difflib.get_close_matches(name, list(full_names(contents)), n=3, cutoff=0.5)
    known = f"did you mean {', '.join(near)}?" if near else _known(contents)
    raise LogError(f"{path}, column {name}: no stream of the log has it; {known}")


def _known(contents: Contents) -> str:
    """Return what a log has: its streams, or the columns of its only one."""
    if len(contents) != 1:
        return f"the streams are {', '.join(contents) or 'none'}."
    (columns,) = contents.values()
    return f"it has {', '.join(columns[:20])}" + (", …." if len(columns) > 20 else ".")


def full_names(contents: Contents) -> Iterator[str]:
    """Yield `stream/column` of every column, and the column's name alone."""
    for stream, columns in contents.items():
        for column in columns:
            yield f"{stream}/{column}"
            yield column


def by_stream(contents: Contents, names: Collection[str], path: str = "log") -> dict[str, list[str]]:
    """Return the named columns by stream, each once.

    Raises: LogError: as `find_column`.
    """
    found: dict[str, list[str]] = {}
    for name in names:
        stream, column = find_column(contents, name, path)
        if column not in found.setdefault(stream, []):
            found[stream].append(column)
    return found
