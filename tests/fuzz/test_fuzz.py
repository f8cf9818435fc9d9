"""Every parser returns or refuses in words, whatever it is given; `make fuzz` searches for
longer.
"""

import hashlib
import os
import random
import resource
import time
import traceback
from pathlib import Path

import pytest

from tests.fuzz.mutation import mutate
from tests.fuzz.targets import TARGETS, Target, check

CORPUS = Path(__file__).with_name("corpus")
SECONDS = float(os.environ.get("NP_DRAKE_FUZZ_SECONDS", "0.4"))
MOST = 1 << 20  # memory that a reader may take for a file of at most 10 MB [KiB]


def random_search(target: Target, folder: Path) -> int:
    """Feed random changes of the seeds to a target until the time is up; return the number of
    inputs. Those that break the reader are kept in a folder.
    """
    rng, count, end = random.Random(target.name), 0, time.monotonic() + SECONDS
    work = folder / "work"
    work.mkdir()
    seeds, path = target.seeds(work), work / f"input{target.suffix}"
    while time.monotonic() < end or not count:
        data = mutate(rng.choice(seeds), rng)
        path.write_bytes(data)
        count += 1
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        try:
            check(target, path)
            broken = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before > MOST
        except Exception:
            traceback.print_exc(limit=-4)
            broken = True
        if broken:
            name = f"{target.name}-{hashlib.sha256(data).hexdigest()[:12]}"
            (folder / name).write_bytes(data)
    return count


@pytest.mark.parametrize("name", TARGETS)
def test_no_change_of_a_good_file_breaks_the_reader(name, tmp_path):
    random_search(TARGETS[name], tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["work"]


@pytest.mark.parametrize("file", sorted(CORPUS.rglob("*.*")), ids=lambda file: file.name)
def test_what_once_broke_a_reader_does_so_no_more(file, tmp_path):
    target = TARGETS[file.parent.name]
    path = tmp_path / f"input{target.suffix}"
    path.write_bytes(file.read_bytes())
    check(target, path)


def test_a_reader_that_breaks_is_found(tmp_path):
    def parse(path):
        raise KeyError("nan")

    random_search(Target("broken", ".csv", parse, lambda folder: [b"1,2,3\n4,5,6\n"]), tmp_path)
    assert len(list(tmp_path.iterdir())) > 1
