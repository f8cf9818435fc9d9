"""No log of 10 MB takes more than 1 GB of memory or a traceback, whatever it unpacks to."""

import gzip
import zlib

import numpy as np
import pytest

from np_drake.logs import columns
from np_drake.logs.errors import LogError
from np_drake.logs.formats.log_file import read as read_flights
from np_drake.logs.formats.neurobem import is_neurobem
from np_drake.logs.opening import open_flights

NAMES = [name for group in columns.COLUMNS.values() for name in group]
HEADER = ",".join(NAMES) + "\n"
SECONDS = 60  # of processor time
READ = """
from np_drake.logs.errors import LogError
from np_drake.logs.formats.log_file import read as read_flights
from np_drake.logs.opening import open_flights
def read(path):
    for one in (read_flights, open_flights):
        try:
            one(path)
            print("read")
        except LogError as error:
            print(error)
"""


@pytest.fixture(scope="module")
def read(fresh_reader):
    return fresh_reader(READ, SECONDS)


def rows(folder):
    """Rows of zeros, 1000 to 1."""
    path = folder / "bomb.csv.gz"
    block = (",".join(["0"] * len(NAMES)) + "\n").encode() * 20_000
    with gzip.open(path, "wb") as file:
        file.write(HEADER.encode())
        for _ in range(150):
            file.write(block)
    return path


def line(folder):
    """One line without an end."""
    path = folder / "bomb.csv.gz"
    with gzip.open(path, "wb", compresslevel=1) as file:
        file.write(HEADER.encode())
        for _ in range(500):
            file.write(b"0" * 10**6)
    return path


def ragged(folder):
    """Short rows below a wide header: every one of them would become a row of 9,000 cells."""
    path = folder / "bomb.csv"
    path.write_text(
        HEADER[:-1] + "," + ",".join(f"x{i}" for i in range(9000)) + "\n" + "1\n" * 10**6
    )
    return path


def constant(folder):
    """Constant columns of Parquet, which need no bytes."""
    pyarrow = pytest.importorskip("pyarrow", reason="Parquet needs pyarrow")
    from pyarrow import parquet

    path = folder / "bomb.parquet"
    column = pyarrow.array(np.zeros(4 * 10**6))
    parquet.write_table(pyarrow.table(dict.fromkeys(NAMES, column)), path, compression="zstd")
    return path


@pytest.mark.parametrize("bomb", [rows, line, ragged, constant], ids=lambda bomb: bomb.__name__)
def test_a_log_that_unpacks_to_gigabytes_is_refused_within_one(tmp_path, bomb, read):
    path = bomb(tmp_path)
    assert path.stat().st_size < 10**7
    said, peak = read(path)
    assert len(said) == 2
    assert all(text.startswith(str(path)) for text in said)
    assert peak < 1000  # [MB]


def damages():
    """A compressed log with a byte turned, all over its header and here and there behind it."""
    content = gzip.compress(HEADER.encode() + b"1,2\n" * 1000, mtime=0)
    for at in [*range(0, 40, 3), *range(40, len(content), 70)]:
        yield content[:at] + bytes([content[at] ^ 0xFF]) + content[at + 1 :]
    yield content[:2] + b"\x07" + content[3:]
    yield content[:10] + zlib.compress(b"t,x\n")[2:-4]
    yield content[:10] + b"\x07\xff\xff"
    yield content[:1]


def test_no_damage_of_a_gzip_is_more_than_a_refusal(tmp_path):
    path = tmp_path / "made.csv.gz"
    for content in damages():
        path.write_bytes(content)
        is_neurobem(path)
        for read in (read_flights, open_flights):
            with pytest.raises(LogError) as found:
                read(path)
            assert "\n" not in str(found.value)
