"""Reads ROS 2 bags: the description of a folder, and sqlite3 storage with its tables of topics and
messages.

Source: rosbag2, storage plugin sqlite3.
"""

import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Collection, Iterator
from pathlib import Path, PurePath

from np_drake.files.yaml_file import read_yaml
from np_drake.logs.formats.bags.budget import Budget, Channel, zstd

MAGIC = b"SQLite format 3\0"
LANGUAGES = {b"ros2msg": "MSG", b"ros2idl": "IDL"}


class Sqlite:
    """Channels and messages of a database, and of the write-ahead file beside it.

    notes: what is to be said of it.
    """

    whole = True

    def __init__(self, path: Path, budget: Budget) -> None:
        """Find all topics and how many messages they have.
        Raises: ValueError: if it is no such database; LogError: beyond the budget.
        """
        self._budget = budget
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self.notes: list[str] = []
        uri = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
        ahead = path.with_name(f"{path.name}-wal")
        if ahead.is_file() and ahead.stat().st_size:
            # A recorder that was killed leaves messages there. They are read of copies: SQLite
            # writes beside the file.
            self._folder = tempfile.TemporaryDirectory()
            copy = Path(self._folder.name) / "bag.db3"
            shutil.copyfile(path, copy)
            shutil.copyfile(ahead, copy.with_name(f"{copy.name}-wal"))
            uri = f"{copy.as_uri()}?mode=ro"
            self.notes.append(
                f"the write-ahead file {ahead.name} is read with it; its recorder did not end well"
            )
        self._database = sqlite3.connect(uri, uri=True)
        self._database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, budget.block)
        self._database.text_factory = bytes
        try:
            self._database.execute("PRAGMA cache_size = -2000")  # [KiB] a file may ask for more
            self.channels = self._channels()
        except sqlite3.Error as error:
            self.close()
            raise ValueError(f"its tables cannot be read ({error})") from error
        except BaseException:
            self.close()
            raise

    def messages(self, channels: Collection[Channel]) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield channel, time of receipt [ns] and bytes of the messages, as they lie in the file.

        Raises: ValueError: at damage; LogError: beyond the budget.
        """
        wanted, take = {c.number: c for c in channels}, self._budget.one_pass()
        numbers = ",".join(map(str, wanted))
        query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({numbers})"
        try:
            for number, time, raw in self._database.execute(query):
                if isinstance(raw, bytes):
                    take(len(raw))
                if number in wanted:
                    yield wanted[number], time, raw
        except sqlite3.DataError as error:  # a value beyond the limit that is set
            raise self._budget.too_large_block() from error
        except sqlite3.Error as error:
            raise ValueError(str(error)) from error

    def close(self) -> None:
        """Close the file."""
        self._database.close()
        if self._folder is not None:
            self._folder.cleanup()

    def _require_tables(self) -> None:
        """Check that what a bag holds is stored: a view may compute rows without end.

        Raises: ValueError: where it is a view, or virtual.
        """
        query = (
            "SELECT name FROM sqlite_master WHERE name IN (?, ?, ?) AND (type <> 'table' OR "
            "sql LIKE 'CREATE VIRTUAL%')"
        )
        names = ("topics", "messages", "message_definitions")
        found = [name.decode(errors="replace") for (name,) in self._database.execute(query, names)]
        if found:
            raise ValueError(
                f"{', '.join(found)} must be tables; a view or virtual table is no record "
                f"of a flight"
            )

    def _channels(self) -> list[Channel]:
        self._require_tables()
        definitions = self._definitions()
        topics = {}
        for number, topic, kind in self._database.execute("SELECT id, name, type FROM topics"):
            if isinstance(number, int) and isinstance(topic, bytes) and isinstance(kind, bytes):
                self._budget.add_channel()
                topics[number] = self._budget.text(topic), self._budget.text(kind)
        counted = self._database.execute(
            "SELECT topic_id, count(*) FROM messages GROUP BY topic_id"
        )
        counts = {number: count for number, count in counted if number in topics}
        return [
            Channel(number, topic, kind, *definitions.get(kind, ("", "")), counts.get(number, 0))
            for number, (topic, kind) in topics.items()
        ]

    def _definitions(self) -> dict[str, tuple[str, str]]:
        """Return language and definition by type; nothing where the bag is older than its table."""
        query = (
            "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = "
            "'message_definitions'"
        )
        if not self._database.execute(query).fetchone()[0]:
            return {}
        found: dict[str, tuple[str, str]] = {}
        query = (
            "SELECT topic_type, encoding, encoded_message_definition FROM "
            "message_definitions ORDER BY id"
        )
        for kind, encoding, definition in self._database.execute(query):
            if isinstance(kind, bytes) and isinstance(definition, bytes):
                language = LANGUAGES.get(encoding, "") if isinstance(encoding, bytes) else ""
                found.setdefault(self._budget.text(kind), (language, self._budget.text(definition)))
        return found


NAME = "metadata.yaml"
LONGEST = 10**6  # characters of a value; the quality of service of many publishers is one text
PIECE = 1 << 20  # [byte]


def described(folder: Path) -> tuple[list[Path], str]:
    """Return the files of a bag and how they are compressed: `file`, `message` or empty.

    Raises: ValueError: if the description does not serve; OSError: if it or a file is not there.
    """
    try:
        about = read_yaml(folder / NAME)["rosbag2_bagfile_information"]
        names = [PurePath(name).name for name in about["relative_file_paths"]]
        mode = str(about.get("compression_mode") or "").lower()
        kind = about.get("compression_format")
    except (TypeError, KeyError, AttributeError) as error:
        raise ValueError(f"it says nothing of {error}") from error
    if mode not in ("", "none") and (mode not in ("file", "message") or kind != "zstd"):
        raise ValueError(f"the compression {kind!r} of every {mode!r} is not known")
    missing = [name for name in names if not (folder / name).is_file()]
    if missing or not names:
        raise FileNotFoundError(
            f"the file {missing[0]} is missing" if missing else "it names no file"
        )
    return [folder / name for name in names], "" if mode == "none" else mode


def unpack(file: Path, folder: Path, take: Callable[[int], None]) -> Path:
    """Decompress a file into a folder, and return the result.
    Raises: ValueError: if it is damaged; LogError: beyond the budget.
    """
    target = folder / file.stem
    module = zstd()
    try:
        with file.open("rb") as raw, module.open(raw, "rb") as packed, target.open("wb") as plain:
            while piece := packed.read(PIECE):
                take(len(piece))
                plain.write(piece)
    except (module.ZstdError, EOFError) as error:
        raise ValueError(f"{file.name} is damaged ({error})") from error
    return target
