"""Files appear whole or not at all, and two runs never write into one output."""

import errno
import json
import os
import socket
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from np_drake.files.file_access import (
    LOCK,
    atomic_path,
    guard_inputs,
    kept_json,
    lock_outputs,
    note_input,
    read_bytes,
    read_json,
    require_writable,
    write_json,
    write_text,
)
from np_drake.logs.opening import open_flights


@pytest.mark.parametrize(
    "error", [RuntimeError("power cut"), OSError(errno.ENOSPC, "No space left on device")]
)
def test_a_writer_that_fails_leaves_what_was_there(tmp_path, error):
    write_text(tmp_path / "note.txt", "old")

    def fail():
        with atomic_path(tmp_path / "note.txt") as temporary:
            temporary.write_text("half")
            raise error

    with pytest.raises(type(error)) as found:
        fail()
    assert isinstance(error, RuntimeError) or found.value.filename == str(tmp_path / "note.txt")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_json_holds_numbers_lists_and_null(tmp_path):
    content = {"x": np.float64(1.5), "y": np.arange(2), "z": float("nan"), "p": tmp_path}
    write_json(tmp_path / "a.json", content)
    expected = {"x": 1.5, "y": [0, 1], "z": None, "p": str(tmp_path)}
    assert json.loads((tmp_path / "a.json").read_text()) == expected


def test_a_pipe_is_never_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="must be an ordinary file"):
        write_text(tmp_path / "pipe", "text")
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_a_link_goes_on_pointing_at_its_file(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "a.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to("there/a.txt")
    write_text(tmp_path / "link.txt", "new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "there" / "a.txt").read_text() == "new"


def test_a_file_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    order = []
    monkeypatch.setattr(os, "fsync", lambda number: order.append("fsync"))
    monkeypatch.setattr(os, "replace", lambda a, b: order.append("replace"))
    write_text(tmp_path / "a.txt", "text")
    assert order == ["fsync", "replace"]


HOLD = """
import sys, time
from pathlib import Path
from np_drake.files.file_access import lock_outputs
with lock_outputs([Path(sys.argv[1])], [Path(sys.argv[2])]):
    print("held", flush=True)
    time.sleep(60)
"""


def hold(folders=(), files=()):
    with lock_outputs(folders, files):
        pass


def test_a_second_run_is_refused_until_the_first_is_dead(tmp_path):
    folder, file = tmp_path / "out", tmp_path / "m.safetensors"
    command = [sys.executable, "-c", HOLD, str(folder), str(file)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        for name, held in (("out", {"folders": [folder]}), ("m.safetensors", {"files": [file]})):
            with pytest.raises(OSError, match=rf"{name}: another run writes here\. Wait for its"):
                hold(**held)
        hold(files=[file.with_name("n.safetensors")])
        process.kill()
    assert (folder / LOCK).exists()  # it left its lock file behind
    hold([folder], [file])
    assert not (folder / LOCK).exists()


def test_a_run_leaves_no_lock_file_and_no_empty_folder_but_its_results(tmp_path):
    hold([tmp_path / "a", tmp_path / "." / "a"], [tmp_path / "m.safetensors"])
    assert list(tmp_path.iterdir()) == []
    with lock_outputs([tmp_path / "a" / "b"]):
        (tmp_path / "a" / "b" / "log.csv").touch()
    assert [path.name for path in (tmp_path / "a" / "b").iterdir()] == ["log.csv"]


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
