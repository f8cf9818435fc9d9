"""Every parser returns or refuses in words, whatever it is given; `make fuzz` searches for
longer.
"""

import os
import random
from pathlib import Path

import pytest
from fuzz import random_search
from mutation import mutate
from targets import REFUSED, TARGETS, Target, check

CORPUS = Path(__file__).with_name("corpus")
SECONDS = float(os.environ.get("NP_DRAKE_FUZZ_SECONDS", "1"))


@pytest.mark.parametrize("name", TARGETS)
def test_no_change_of_a_good_file_breaks_the_reader(name, tmp_path):
    count = random_search(TARGETS[name], SECONDS, tmp_path, seed=0)
    assert count > 0
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("file", sorted(CORPUS.rglob("*.*")), ids=lambda file: file.name)
def test_what_once_broke_a_reader_does_so_no_more(file, tmp_path):
    target = TARGETS[file.parent.name]
    path = tmp_path / f"input{target.suffix}"
    path.write_bytes(file.read_bytes())
    check(target, path)


def test_a_reader_that_breaks_is_found(tmp_path):
    def parse(path):
        if b"nan" in path.read_bytes():
            raise KeyError("nan")

    target = Target("broken", ".csv", parse, lambda folder: [b"1,2,3\n4,5,6\n"])
    random_search(target, 1.0, tmp_path, seed=0)
    assert list(tmp_path.iterdir())


def test_a_refusal_without_a_word_counts_as_broken(tmp_path):
    def parse(path):
        raise ValueError(" ")

    (tmp_path / "a").write_bytes(b"")
    with pytest.raises(AssertionError, match="without a word"):
        check(Target("silent", "", parse, lambda folder: [b""]), tmp_path / "a")


def test_changes_repeat_with_their_seed():
    one, two = (mutate(b"a,b\n1,2\n", random.Random(3)) for _ in range(2))
    assert one == two
    assert issubclass(REFUSED[0], ValueError)
