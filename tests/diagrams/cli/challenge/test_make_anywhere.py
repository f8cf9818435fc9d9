"""Law: `np-drake challenge make` writes the same set wherever its cases fly, and after a kill in
the middle.
"""

import os
import signal
import subprocess
import sys
import time

import pytest

from diagrams.cli.main import run

SMALL = ["--cases", "2", "--clean", "1", "--seconds", "5", "--seed", "11"]


def command(folder, *more):
    return [
        "challenge",
        "make",
        "--out",
        f"{folder}/cases",
        "--truth",
        f"{folder}/truth",
        *SMALL,
        *more,
    ]


def content(folder):
    """Bytes of every file of a set by its place."""
    return {
        str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()
    }


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    folder = tmp_path_factory.mktemp("alone")
    assert run(command(folder, "--jobs", "1")) == 0
    return content(folder)


@pytest.mark.nightly
def test_on_a_cluster_of_two(alone, tmp_path):
    distributed = pytest.importorskip("distributed", reason="needs the extra `cluster`")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0"
    ) as local:
        assert run(command(tmp_path, "--scheduler", local.scheduler_address)) == 0
    assert content(tmp_path) == alone


@pytest.mark.nightly
def test_on_two_processes_that_are_killed_in_the_middle_and_begun_anew(alone, tmp_path):
    program = [sys.executable, "-m", "np_drake", *command(tmp_path, "--jobs", "2")]
    with subprocess.Popen(program, start_new_session=True) as flying:
        until = time.monotonic() + 120.0  # [s]
        while not list(tmp_path.glob("cases/[0-9a-f]*/vehicle.yaml")) and time.monotonic() < until:
            time.sleep(0.01)
        os.killpg(flying.pid, signal.SIGKILL)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("cases/[0-9a-f]*/*.csv")}
    assert 0 < len(before) < len([name for name in alone if name.endswith(".csv")])
    assert run(command(tmp_path, "--jobs", "2")) == 0
    assert content(tmp_path) == alone
    assert before == {
        path: path.stat().st_mtime_ns for path in before
    }  # what was flown is not flown again
