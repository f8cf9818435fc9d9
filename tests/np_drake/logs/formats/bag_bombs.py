"""Makes small bags that ask much memory of their reader: what they unpack to, repeat or define has
gigabytes.
"""

import functools
import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path

import pytest

lz4 = pytest.importorskip("lz4.frame")
zstd = pytest.importorskip("rosbags.rosbag2.storage_mcap").zstd

PIECE = bytes(30 * 10**6)
MANY = 40  # pieces; 1.2 GB
TYPE = "made/msg/Bytes"
DEFINITION = "uint8[] data\n"
TIME = 10**9  # [ns]
MCAP = b"\x89MCAP0\r\n"


@functools.cache
def pack(kind: str, start: bytes, pieces: int) -> bytes:
    """Return `start` and that many pieces of zeros, compressed as one."""
    if kind == "lz4":
        compressor = lz4.LZ4FrameCompressor()
        first = compressor.begin()
    else:
        compressor = zstd.ZstdCompressor()
        first = b""
    parts = [compressor.compress(start), *(compressor.compress(PIECE) for _ in range(pieces))]
    return b"".join([first, *parts, compressor.flush()])


def message1(data: bytes) -> bytes:
    """Return a ROS 1 message of `DEFINITION`."""
    return struct.pack("<I", len(data)) + data


def message2(data: bytes) -> bytes:
    """Return a ROS 2 message of `DEFINITION`."""
    return b"\0\1\0\0" + struct.pack("<I", len(data)) + data


def record1(fields: dict[str, bytes], data: bytes, size: int | None = None) -> bytes:
    """Return a record of a ROS 1 bag. size: that it claims its data to have."""
    header = b"".join(
        struct.pack("<I", len(name) + 1 + len(value)) + name.encode() + b"=" + value
        for name, value in fields.items()
    )
    length = len(data) if size is None else size
    return struct.pack("<I", len(header)) + header + struct.pack("<I", length) + data


def number(value: int) -> bytes:
    """Return a number of 4 bytes."""
    return struct.pack("<I", value)


def bag1(
    path: Path,
    kind: str,
    *,
    pieces: int = MANY,
    size: int | None = None,
    chunk_infos: int = 1,
    entries: int = 1,
) -> Path:
    """Write a ROS 1 bag of one chunk: a message of 3 bytes and one of zeros.

    size: that the chunk claims.
    chunk_infos, entries: how often the index names them.
    """
    about = {
        "topic": b"/a",
        "type": b"made/Bytes",
        "md5sum": b"0" * 32,
        "message_definition": b"uint8[] data",
    }
    fields = record1(about, b"")[4:-4]
    connection = record1({"op": b"\x07", "conn": number(0), "topic": b"/a"}, fields)
    stamp = struct.pack("<II", 1, 0)
    head = {"op": b"\x02", "conn": number(0), "time": stamp}
    zeros = pieces * len(PIECE)
    first = record1(head, message1(b"abc"))
    start = first + record1(head, number(max(zeros - 4, 0)), zeros + 4) if zeros else first
    content = pack(kind, start, pieces) if kind != "none" else start
    claimed = len(start) + zeros if size is None else size
    chunk = record1({"op": b"\x05", "compression": kind.encode(), "size": number(claimed)}, content)
    before = b"#ROSBAG V2.0\n"
    position = len(before) + 4096
    index = record1(
        {"op": b"\x04", "ver": number(1), "conn": number(0), "count": number(entries)},
        (stamp + number(0)) * entries,
    )
    info = record1(
        {"op": b"\x06", "ver": number(1), "chunk_pos": struct.pack("<Q", position)}
        | {"start_time": stamp, "end_time": stamp, "count": number(1)},
        number(0) + number(entries),
    )
    end = position + len(chunk) + len(index)
    header = {"op": b"\x03", "index_pos": struct.pack("<Q", end), "conn_count": number(1)}
    header["chunk_count"] = number(chunk_infos)
    opening = record1(header, b" " * (4096 - len(record1(header, b""))))
    path.write_bytes(before + opening + chunk + index + connection + info * chunk_infos)
    return path


def text(value: str | bytes) -> bytes:
    """Return a text with its length."""
    raw = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(raw)) + raw


def record2(code: int, content: bytes) -> bytes:
    """Return a record of an MCAP file."""
    return struct.pack("<BQ", code, len(content)) + content


def schema2(definition: str = DEFINITION) -> bytes:
    """Return a schema record."""
    return record2(3, struct.pack("<H", 1) + text(TYPE) + text("ros2msg") + text(definition))


def channel2() -> bytes:
    """Return a channel record."""
    metadata = text(text("offered_qos_profiles") + text(""))
    return record2(4, struct.pack("<HH", 1, 1) + text("/a") + text("cdr") + metadata)


def row2(data: bytes) -> bytes:
    """Return a message record."""
    return record2(5, struct.pack("<HIQQ", 1, 0, TIME, TIME) + data)


def chunk2(kind: str, packed: bytes, size: int) -> bytes:
    """Return a chunk record."""
    head = struct.pack("<QQQI", TIME, TIME, size, 0)
    return record2(6, head + text(kind) + struct.pack("<Q", len(packed)) + packed)


def mcap(
    path: Path,
    chunk: bytes,
    size: int,
    kind: str,
    *,
    end: str = "index",
    known: bytes = schema2() + channel2(),
) -> Path:
    """Write an MCAP file of one chunk. end: `index`, or `footer` without one.   known: schemas and
    channels.
    """
    opening = MCAP + record2(1, text("ros2") + text("made"))
    body = record2(15, bytes(4))
    at = len(opening) + len(chunk) + len(body)
    summary = b""
    if end == "index":
        places = struct.pack("<HQ", 1, len(opening) + len(chunk))
        place = struct.pack("<QQQQ", TIME, TIME, len(opening), len(chunk)) + text(places)
        unpacked = struct.pack("<QQ", len(chunk) - 49 - len(kind), size)
        place += struct.pack("<Q", 31) + text(kind) + unpacked
        counts = text(struct.pack("<HQ", 1, 1))
        facts = struct.pack("<QHIIIIQQ", 1, 1, 1, 0, 0, 1, TIME, TIME) + counts
        summary = known + record2(8, place) + record2(11, facts)
    footer = record2(2, struct.pack("<QQI", at if summary else 0, 0, 0)) + MCAP
    path.write_bytes(opening + chunk + body + summary + footer)
    return path


def mcap_zeros(path: Path, end: str) -> Path:
    """Write an MCAP file whose chunk holds a small message and one of zeros."""
    zeros = MANY * len(PIECE)
    small = schema2() + channel2() + row2(message2(b"abc"))
    large = (
        struct.pack("<BQHIQQ", 5, 22 + 8 + zeros, 1, 0, TIME, TIME)
        + message2(b"")[:4]
        + struct.pack("<I", zeros)
    )
    size = len(small) + len(large) + zeros
    return mcap(
        path, chunk2("zstd", pack("zstd", small + large, MANY), size), size, "zstd", end=end
    )


def mcap_content(
    path: Path, content: bytes, *, known: bytes = schema2() + channel2(), **options
) -> Path:
    """Write an MCAP file of one chunk of zstd with this content after its schemas and channels."""
    whole = known + content
    return mcap(
        path,
        chunk2("zstd", zstd.compress(whole), len(whole)),
        len(whole),
        "zstd",
        known=known,
        **options,
    )


def bag_rows(path: Path) -> Path:
    """Write 95 MB of equal messages of 32 bytes, every one a column of its own."""
    return mcap_content(path, row2(message2(bytes(32))) * (95 * 10**6 // 71), end="index")


def bag_lengths(path: Path) -> Path:
    """Write a message of millions of empty strings."""
    count = 20 * 10**6
    return mcap_content(
        path,
        row2(b"\0\1\0\0" + struct.pack("<I", count) + bytes(4 * count)),
        known=schema2("string[] data\n") + channel2(),
    )


def bag_definitions(path: Path) -> Path:
    """Write a definition of types of many megabytes, without an index."""
    definition = "".join(f"float64 field_{k}\n" for k in range(10**6))
    return mcap_content(
        path, row2(message2(b"abc")), known=schema2(definition) + channel2(), end="footer"
    )


def database(
    path: Path, data: str = "data BLOB NOT NULL", rows: int = 1, raw: bytes = message2(b"abc")
) -> Path:
    """Write a sqlite3 bag. data: the column of the messages.   raw: what stands in it, if it is no
    made one.
    """
    with sqlite3.connect(path) as file:
        file.executescript(
            "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT);"
            "INSERT INTO schema VALUES (4, 'jazzy');"
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format"
            " TEXT, offered_qos_profiles TEXT, type_description_hash TEXT);"
            f"INSERT INTO topics VALUES (1, '/a', '{TYPE}', 'cdr', '', '');"
            "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT, encoding"
            " TEXT, encoded_message_definition TEXT, type_description_hash TEXT);"
            f"INSERT INTO message_definitions VALUES (1, '{TYPE}', 'ros2msg', '{DEFINITION}', '');"
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,"
            f" {data})"
        )
        for _ in range(rows):
            if "GENERATED" in data:
                file.execute("INSERT INTO messages(topic_id, timestamp) VALUES (1, ?)", (TIME,))
            else:
                file.execute(
                    "INSERT INTO messages(topic_id, timestamp, data) VALUES (1, ?, ?)", (TIME, raw)
                )
    file.close()
    return path


def message_mode(path: Path) -> Path:
    """Write a folder whose one message unpacks to zeros."""
    path.mkdir()
    zeros = MANY * len(PIECE)
    raw = pack("zstd", message2(b"")[:4] + struct.pack("<I", zeros), MANY)
    database(path / "a.db3", raw=raw)
    return path


def file_mode(path: Path) -> Path:
    """Write a folder whose one file unpacks to a database and zeros."""
    path.mkdir()
    plain = database(path / "a.db3")
    (path / "a.db3.zstd").write_bytes(pack("zstd", plain.read_bytes(), MANY))
    plain.unlink()
    return path


BOMBS: dict[str, Callable[[Path], Path]] = {
    "bag_lz4_claims_little": lambda at: bag1(at / "a.bag", "lz4", size=1000),
    "bag_index": lambda at: bag1(at / "a.bag", "none", pieces=0, chunk_infos=200, entries=400_000),
    "mcap_zstd": lambda at: mcap_zeros(at / "a.mcap", "index"),
    "mcap_zstd_no_index": lambda at: mcap_zeros(at / "a.mcap", "footer"),
    "mcap_rows": lambda at: bag_rows(at / "a.mcap"),
    "mcap_lengths": lambda at: bag_lengths(at / "a.mcap"),
    "mcap_definitions": lambda at: bag_definitions(at / "a.mcap"),
    "sqlite_message": lambda at: message_mode(at / "a"),
    "sqlite_file": lambda at: file_mode(at / "a"),
    "sqlite_generated": lambda at: database(
        at / "a.db3", "data BLOB GENERATED ALWAYS AS (zeroblob(900000000))", rows=3
    ),
}
