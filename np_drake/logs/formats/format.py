"""What a format of flight logs provides."""

import dataclasses as dc
from collections.abc import Callable, Mapping
from pathlib import Path

from np_drake.logs.importing.log_map import LogMap
from np_drake.logs.recording import Contents, Progress, Recording


@dc.dataclass(frozen=True)
class Format:
    """One format of flight logs, each in a file of this folder.

    name: as in a map's `format`.   title: for people.   extra: of np_drake that installs its library; None: none.
    recognises: whether a file is of this format, from its path and its first 4096 bytes.
    contents: names of streams and columns, and facts of the header, read without the rows where the format allows.
    default_map: the map where the log's own names say what they hold; None where only its user knows.
    read: the streams and columns that are wanted; memory must not grow with what is not. Calls its last argument with
        the share of the file that is read.
    All raise LogError, one line with file, place and remedy, on a damaged file or without the library.
    """

    name: str
    title: str
    extra: str | None
    recognises: Callable[[Path, bytes], bool]
    contents: Callable[[Path], Contents]
    default_map: Callable[[Contents], LogMap | None]
    read: Callable[[Path, Mapping[str, list[str]], Progress], Recording]
