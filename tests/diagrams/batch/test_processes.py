"""Laws of work in other processes, of this machine or of a Dask cluster (extra `cluster`).

The work is defined inside the tests, so that it travels by value.
"""

import os
import signal
import socket
import threading
import time
from contextlib import contextmanager
from functools import partial

import pytest

from diagrams.batch import run as batch_run
from diagrams.batch.run import FailedRun, Workers, as_they_finish, connect
from diagrams.cli.main import run

CASES = [{"number": number} for number in range(4)]


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_case_has_its_value_from_another_process(jobs):
    dut = dict(as_they_finish(lambda case: (case**2, os.getpid()), [3, 1, 2], jobs))
    assert {number: square for number, (square, _) in dut.items()} == {0: 9, 1: 1, 2: 4}
    assert os.getpid() not in {process for _, process in dut.values()}


def test_what_the_work_raises_reaches_the_caller():
    def work(case):
        if case == 1:
            raise ValueError("mass must be positive")
        return case

    with pytest.raises(ValueError, match="mass must be positive"):
        list(as_they_finish(work, [0, 1, 2], 2))


def test_processes_that_die_lose_their_own_cases_only():
    def work(case):
        if case == 1:
            os._exit(7)
        if case == 4:
            os.kill(os.getpid(), signal.SIGKILL)
        return case

    dut = dict(as_they_finish(work, range(6), jobs=2))
    assert sorted(dut) == list(range(6))
    assert [case for case in range(6) if isinstance(dut[case], FailedRun)] == [1, 4]
    assert "EXIT(7)" in str(dut[1])
    assert "SIGKILL" in str(dut[4])


@contextmanager
def cluster_of(workers, threads=1):
    """Yield the address of a scheduler whose workers come back when they die.

    A case is given up at its second dead worker.
    """
    reason = "needs the extra `cluster`: pip install 'np_drake[cluster]'"
    distributed = pytest.importorskip("distributed", reason=reason)
    dask = pytest.importorskip("dask", reason=reason)
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        distributed.LocalCluster(
            n_workers=workers, threads_per_worker=threads, dashboard_address=":0"
        ) as local,
    ):
        yield local.scheduler_address
        # Dask cannot close a worker that is being started after a death.
        deadline = time.monotonic() + 60.0
        while not all_run(local, workers):
            assert time.monotonic() < deadline, "a dead worker did not come back"
            time.sleep(0.05)


def all_run(cluster, workers):
    """Return whether every worker is known to the scheduler and its process has started."""
    processes = [nanny.process for nanny in cluster.workers.values()]
    return len(cluster.scheduler.workers) == workers and all(
        process is not None and process.status.name == "running" for process in processes
    )


def test_a_cluster_answers_as_one_machine_and_a_dead_worker_loses_one_case(tmp_path):
    def work(case):
        if case["number"] == 1:
            os._exit(3)
        if case["number"] == 2:
            raise ValueError("mass must be positive")
        return {"square": case["number"] ** 2}

    with cluster_of(1) as address:
        workers = Workers(folder=tmp_path, scheduler=address)
        there = workers.run(work, CASES, config={})
        again = workers.run(dict, CASES[3:], config={})
    here = Workers().run(work, CASES, config={})
    assert [r.get("result") for r in here] == [{"square": 0}, None, None, {"square": 9}]
    assert "lost" in there[1]["error"]
    assert there[2]["error"] == here[2]["error"] == "mass must be positive"
    assert there[3]["result"] == again[0]["result"] == {"square": 9}


def test_workers_of_several_threads_are_refused_before_work():
    with cluster_of(1, threads=2) as found, pytest.raises(ValueError, match="one thread each"):
        Workers(scheduler=found).run(dict, CASES, config={})


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "no address"])
def test_a_scheduler_that_does_not_answer_is_one_line(address, monkeypatch, capsys):
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    monkeypatch.setattr(batch_run, "connect", partial(connect, patience=0.2))
    before = set(threading.enumerate())
    assert run(["reproduce", "robustness", "--scheduler", address]) == 2
    err = capsys.readouterr().err
    said = f"--scheduler: no Dask scheduler answers at '{address}'."
    assert err.splitlines()[-1] == f"np-drake reproduce robustness: {said}"
    assert set(threading.enumerate()) <= before


def test_what_accepts_a_connection_and_says_nothing_is_no_scheduler():
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    with socket.create_server(("127.0.0.1", 0)) as silent:
        dut = connect(f"tcp://127.0.0.1:{silent.getsockname()[1]}", patience=0.3)
        with pytest.raises(ValueError, match="no Dask scheduler answers"), dut:
            pass


def test_without_the_extra_it_is_one_line(monkeypatch, capsys):
    monkeypatch.setattr(batch_run, "find_spec", lambda name: None)
    assert run(["reproduce", "robustness", "--scheduler", "tcp://127.0.0.1:1"]) == 2
    assert "pip install 'np_drake[cluster]'" in capsys.readouterr().err.splitlines()[-1]
