"""An input asks for no more memory than its budget."""

import os
import socket
from pathlib import Path

import pytest

from np_drake.files.atomic_file import require_writable, write_text
from np_drake.files.input_file import guard_inputs, kept_json, note_input, read_bytes, read_json
from np_drake.logs.opening import open_flights


def test_a_file_beyond_its_limit_is_refused(tmp_path):
    (tmp_path / "a.yaml").write_bytes(bytes(11))
    assert read_bytes(tmp_path / "a.yaml", 11) == bytes(11)
    with pytest.raises(ValueError, match=r"a\.yaml: must hold at most 1e-05 MB"):
        read_bytes(tmp_path / "a.yaml", 10)
    with pytest.raises(ValueError, match="must hold at most 1 MB"):
        read_bytes("/dev/zero", 10**6)


def test_json_that_is_nested_too_deeply_is_no_fault_of_the_program(tmp_path):
    (tmp_path / "a.json").write_text("[" * 10**5)
    with pytest.raises(ValueError, match="nested"):
        read_json(tmp_path / "a.json")


@pytest.mark.parametrize("text", ["", '{"a": 1', "\x00" * 40, "[" * 10**5])
def test_a_result_that_was_cut_off_is_made_again(tmp_path, text, caplog):
    (tmp_path / "a.json").write_text(text)
    assert kept_json(tmp_path / "a.json") is None
    assert "made again" in caplog.text
    assert kept_json(tmp_path / "none.json") is None


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("1")
    return path


def test_no_name_of_an_input_is_written(log):
    soft, hard = log.with_name("soft.json"), log.with_name("hard.json")
    soft.symlink_to(log)
    hard.hardlink_to(log)
    with guard_inputs([log]):
        for name in (log, log.parent / ".." / log.parent.name / log.name, soft, hard):
            for write in (require_writable, lambda path: write_text(path, "2")):
                with pytest.raises(FileExistsError, match=r"must not be a file that is read"):
                    write(name)
    assert log.read_text() == "1"


def test_a_file_is_an_input_once_it_is_read(log):
    with guard_inputs([]):
        write_text(log, "2")
        note_input(log)
        write_text(log, "3")  # of the run itself
        kept_json(log)  # of an earlier run
        write_text(log, "4")
    with guard_inputs([]):
        read_json(log)
        with pytest.raises(FileExistsError):
            write_text(log, "5")
    note_input(log)
    write_text(log, "6")  # without a guard a library writes what it is told to
    assert log.read_text() == "6"


@pytest.mark.parametrize("kind", ["named pipe", "socket"])
def test_what_never_ends_is_refused_before_it_is_opened(tmp_path, monkeypatch, kind):
    monkeypatch.chdir(tmp_path)
    if kind == "socket":
        with socket.socket(socket.AF_UNIX) as made:
            made.bind("endless")
    else:
        os.mkfifo("endless")
    for read in (read_json, open_flights, note_input):
        with pytest.raises(ValueError, match=f"endless: must be a file or a folder; got a {kind}"):
            read(Path("endless"))
