"""No log of 10 MB takes more than 1 GB of memory or a traceback, whatever it unpacks to."""

import gzip

import pytest

from np_drake.logs import columns

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


def ragged(folder):
    """Short rows below a wide header: every one of them would become a row of 9,000 cells."""
    path = folder / "bomb.csv"
    path.write_text(
        HEADER[:-1] + "," + ",".join(f"x{i}" for i in range(9000)) + "\n" + "1\n" * 10**6
    )
    return path


@pytest.mark.parametrize("bomb", [rows, ragged], ids=lambda bomb: bomb.__name__)
def test_a_log_that_unpacks_to_gigabytes_is_refused_within_one(tmp_path, bomb, read):
    path = bomb(tmp_path)
    assert path.stat().st_size < 10**7
    said, peak = read(path)
    assert len(said) == 2
    assert all(text.startswith(str(path)) for text in said)
    assert peak < 1000  # [MB]
