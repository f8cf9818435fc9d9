"""Files appear whole or not at all."""

import json

import numpy as np
import pytest

from np_drake.atomic_file import atomic_path, write_json, write_text


def test_a_writer_that_fails_leaves_nothing(tmp_path):
    write_text(tmp_path / "note.txt", "old")

    def fail():
        with atomic_path(tmp_path / "note.txt") as temporary:
            temporary.write_text("half")
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        fail()
    assert [path.name for path in tmp_path.iterdir()] == ["note.txt"]
    assert (tmp_path / "note.txt").read_text() == "old"


def test_json_holds_numbers_lists_and_null(tmp_path):
    write_json(
        tmp_path / "a.json", {"x": np.float64(1.5), "y": np.arange(2), "z": float("nan"), "p": tmp_path}
    )
    assert json.loads((tmp_path / "a.json").read_text()) == {
        "x": 1.5,
        "y": [0, 1],
        "z": None,
        "p": str(tmp_path),
    }


@pytest.mark.parametrize("place", ["missing/a.txt", "."])
def test_a_place_that_cannot_be_written_is_named(tmp_path, place):
    with pytest.raises(OSError, match="folder"):
        write_text(tmp_path / place, "text")
