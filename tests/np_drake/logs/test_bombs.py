"""No log of 10 MB takes more than 1 GB of memory or a traceback, whatever it unpacks to."""

import gzip

from np_drake.logs import columns

NAMES = [name for group in columns.COLUMNS.values() for name in group]
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


def test_a_log_that_unpacks_to_gigabytes_is_refused_within_one(tmp_path, fresh_reader):
    path = tmp_path / "bomb.csv.gz"
    block = (",".join(["0"] * len(NAMES)) + "\n").encode() * 20_000  # rows of zeros, 1000 to 1
    with gzip.open(path, "wb") as file:
        file.write((",".join(NAMES) + "\n").encode())
        for _ in range(150):
            file.write(block)
    assert path.stat().st_size < 10**7
    said, peak = fresh_reader(READ, 60)(path)  # [s] of processor time
    assert len(said) == 2
    assert all(text.startswith(str(path)) for text in said)
    assert peak < 1000  # [MB]
