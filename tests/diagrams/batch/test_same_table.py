"""Law: a campaign has the same table wherever it runs, and after a kill in the middle."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from diagrams.batch.campaign import run_campaign

CASES = 6
# The work draws, and adds up numbers that do not commute in floating point: nothing but its case
# may enter.
PROGRAM = """
import sys
from pathlib import Path
from diagrams.batch.campaign import run_campaign


def work(case):
    import time
    import numpy as np

    time.sleep(0.2)
    return {"sum": float(np.random.default_rng(case["seed"]).standard_normal(1000).sum())}


if __name__ == "__main__":
    cases = [{"seed": seed} for seed in range(int(sys.argv[3]))]
    run_campaign(work, cases, config={"of": "sums"}, folder=Path(sys.argv[1]), jobs=int(sys.argv[2]))
"""  # noqa: E501


def sum_of(seed):
    return float(np.random.default_rng(seed).standard_normal(1000).sum())


def table(folder, jobs=1, scheduler=""):
    """Sums in the order of the cases."""

    def work(case):  # travels by value, as a worker cannot import this file
        import numpy as np

        return {"sum": float(np.random.default_rng(case["seed"]).standard_normal(1000).sum())}

    cases = [{"seed": seed} for seed in range(CASES)]
    records = run_campaign(
        work, cases, config={"of": "sums"}, folder=folder, jobs=jobs, scheduler=scheduler
    )
    return [record["result"]["sum"] for record in records]


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    return table(tmp_path_factory.mktemp("alone"))


def test_it_is_that_of_the_work_alone(alone):
    assert alone == [sum_of(seed) for seed in range(CASES)]


def test_on_two_processes(alone, tmp_path):
    assert table(tmp_path, jobs=2) == alone


def test_on_a_cluster_of_two(alone, tmp_path):
    distributed = pytest.importorskip("distributed", reason="needs the extra `cluster`")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0"
    ) as local:
        assert table(tmp_path, scheduler=local.scheduler_address) == alone


@pytest.mark.parametrize("jobs", [1, 2])
def test_after_a_kill_in_the_middle(alone, tmp_path, jobs):
    program, folder = tmp_path / "program.py", tmp_path / "cases"
    program.write_text(PROGRAM)
    command = [sys.executable, str(program), str(folder), str(jobs), str(CASES)]
    with subprocess.Popen(command, start_new_session=True) as run:
        until = time.monotonic() + 60.0  # [s]
        while len(list(folder.glob("[0-9a-f]*.json"))) < 2 and time.monotonic() < until:
            time.sleep(0.01)
        os.killpg(run.pid, signal.SIGKILL)
    there = {path: path.stat().st_mtime_ns for path in folder.glob("[0-9a-f]*.json")}
    assert 2 <= len(there) < CASES
    assert table(folder, jobs=2) == alone
    assert {path: path.stat().st_mtime_ns for path in there} == there  # nothing was done twice
