"""Files appear whole or not at all."""

import errno
import json
import os
import shutil
import stat
import subprocess
from types import SimpleNamespace

import numpy as np
import pytest

from np_drake.files.atomic_file import DiskFull, atomic_path, write_json, write_text


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
        tmp_path / "a.json",
        {"x": np.float64(1.5), "y": np.arange(2), "z": float("nan"), "p": tmp_path},
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


def test_a_device_is_never_replaced(tmp_path):
    full = tmp_path / "full"
    try:
        os.mknod(full, 0o666 | stat.S_IFCHR, os.makedev(1, 7))
    except PermissionError:
        pytest.skip("only root makes devices")
    with pytest.raises(
        OSError, match=r"full: must be an ordinary file to write; it is a device\. Choose"
    ):
        write_text(full, "text")
    assert stat.S_ISCHR(full.stat().st_mode)


def test_a_pipe_is_never_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="must be an ordinary file"):
        write_text(tmp_path / "pipe", "text")
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_the_null_device_takes_everything_and_stays_one(tmp_path):
    sink = tmp_path / "null"
    if os.geteuid() == 0:  # one that is not the machine's, which a fault would replace
        os.mknod(sink, 0o666 | stat.S_IFCHR, os.stat(os.devnull).st_rdev)
    else:
        sink.symlink_to(os.devnull)
    write_text(sink, "text")
    assert stat.S_ISCHR(sink.stat().st_mode)
    assert [path.name for path in tmp_path.iterdir()] == ["null"]


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
    assert order == ["fsync", "replace", "fsync"]  # the file, its name, the folder


LINE = (
    r"a\.txt: must have room on the disk, at least .* MB; .* MB are free in .*\. Free some, "
    r"or choose another"
)


def test_a_file_larger_than_the_room_left_is_refused_before_it_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=3))
    with pytest.raises(DiskFull, match=LINE):
        write_text(tmp_path / "a.txt", "text")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
def test_a_disk_that_fills_up_while_writing_leaves_nothing(tmp_path, monkeypatch, number):
    (tmp_path / "a.txt").write_text("old")

    def fill_the_disk():
        with atomic_path(tmp_path / "a.txt") as temporary:
            temporary.write_bytes(bytes(10**6))
            raise OSError(number, "No space left on device")

    with pytest.raises(DiskFull, match=LINE) as found:
        fill_the_disk()
    assert "at least 1 MB" in str(found.value)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_a_disk_that_is_really_full_is_said_to_be(tmp_path):
    folder = tmp_path / "small"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)], capture_output=True
    )
    if mounted.returncode:
        pytest.skip("only root mounts a small disk")
    try:
        with pytest.raises(DiskFull, match=LINE), atomic_path(folder / "a.txt") as temporary:
            temporary.write_bytes(bytes(10**6))
        assert list(folder.iterdir()) == []
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def test_a_link_to_itself_is_refused_as_bad_input(tmp_path):
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    with pytest.raises(OSError, match="symbolic links"):
        write_text(loop, "x")
    assert os.listdir(tmp_path) == ["loop"]
