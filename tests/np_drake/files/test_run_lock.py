"""Two runs never write into one output; a dead run holds nobody up."""

import signal
import subprocess
import sys

import pytest

from np_drake.files.run_lock import NAME, Occupied, lock_outputs

HOLD = """
import sys, time
from pathlib import Path
from np_drake.files.run_lock import lock_outputs
with lock_outputs([Path(sys.argv[1])], [Path(sys.argv[2])]):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def other(tmp_path):
    """Another process that holds a folder and a file."""
    places = tmp_path / "out", tmp_path / "m.safetensors"
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, *map(str, places)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "held\n"
    yield process, *places
    process.kill()
    process.communicate()


def hold(folders=(), files=()):
    with lock_outputs(folders, files):
        pass


def test_a_second_run_is_refused_and_told_who_writes(other):
    process, folder, file = other
    line = (
        rf"another run \(process {process.pid} on .*\) writes here\. Wait for its end, or "
        rf"choose another --out"
    )
    with pytest.raises(Occupied, match=rf"out: {line}"):
        hold(folders=[folder])
    with pytest.raises(Occupied, match=rf"m\.safetensors: {line}"):
        hold(files=[file])


def test_another_file_beside_it_is_free(other):
    _, _, file = other
    hold(files=[file.with_name("n.safetensors")])


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_the_lock_of_a_dead_process_holds_nobody_up(other, number):
    process, folder, file = other
    process.send_signal(number)
    process.wait()
    assert (folder / NAME).exists()  # it left its lock file behind
    hold([folder], [file])
    assert not (folder / NAME).exists()


def test_a_run_leaves_neither_a_lock_file_nor_an_empty_folder(tmp_path):
    hold([tmp_path / "a" / "b"], [tmp_path / "m.safetensors"])
    assert list(tmp_path.iterdir()) == []


def test_a_folder_with_results_stays(tmp_path):
    with lock_outputs([tmp_path / "a" / "b"]):
        (tmp_path / "a" / "b" / "log.csv").touch()
    assert [path.name for path in (tmp_path / "a" / "b").iterdir()] == ["log.csv"]


def test_of_many_runs_at_once_one_writes(tmp_path):
    """Each adds a line at its start and at its end: they never interleave."""
    program = """
import sys, time
from pathlib import Path
from np_drake.files.run_lock import Occupied, lock_outputs
for _ in range(30):
    try:
        with lock_outputs([Path(sys.argv[1])]), open(sys.argv[2], "a") as file:
            file.write("begin\\n"); file.flush(); time.sleep(0.002); file.write("end\\n")
    except Occupied:
        time.sleep(0.001)
"""
    arguments = [str(tmp_path / "out"), str(tmp_path / "lines")]
    runs = [subprocess.Popen([sys.executable, "-c", program, *arguments]) for _ in range(3)]
    assert [run.wait() for run in runs] == [0, 0, 0]
    lines = (tmp_path / "lines").read_text().split()
    assert lines == ["begin", "end"] * (len(lines) // 2)
    assert len(lines) > 2


def test_a_second_command_is_refused_before_it_begins(other):
    _, folder, _ = other
    command = [
        sys.executable,
        "-m",
        "np_drake",
        "fly",
        "hover",
        "--duration",
        "1",
        "--out",
        str(folder),
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith(f"np-drake fly: {folder}: another run (process ")
    assert done.stderr.count("\n") == 1


def test_a_run_that_names_a_folder_twice_does_not_wait_for_itself(tmp_path):
    with lock_outputs([tmp_path / "out", tmp_path / "there" / ".." / "out"]):
        assert (tmp_path / "out").is_dir()
