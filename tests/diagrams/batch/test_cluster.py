"""Laws of campaigns on a Dask cluster, on one of this machine. Needs the extra `cluster`."""

import os
import signal
import socket
import threading
import time
from contextlib import contextmanager
from functools import partial
from types import SimpleNamespace

import pytest

from diagrams.batch import cluster
from diagrams.batch.campaign import run_campaign
from diagrams.batch.failed_run import FailedRun
from diagrams.batch.processes import DeadProcess
from diagrams.cli.main import run

CASES = [{"number": number} for number in range(4)]


@pytest.fixture
def address():
    with cluster_of(1) as found:
        yield found


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


def test_a_cluster_answers_as_one_machine_and_a_dead_worker_loses_one_case(address, tmp_path):
    def work(case):
        if case["number"] == 1:
            os._exit(3)
        if case["number"] == 2:
            raise ValueError("mass must be positive")
        return {"square": case["number"] ** 2}

    there = run_campaign(work, CASES, config={}, folder=tmp_path, scheduler=address)
    here = run_campaign(work, CASES, config={}, jobs=1)
    assert (
        [r.get("result") for r in there]
        == [r.get("result") for r in here]
        == [{"square": 0}, None, None, {"square": 9}]
    )
    assert (
        there[1]["error"] == "lost: its workers died, one after the other; is the memory exhausted?"
    )
    assert there[2]["error"] == here[2]["error"] == "mass must be positive"
    assert len(list(tmp_path.iterdir())) == len(CASES)


def test_one_of_two_workers_that_is_killed_costs_nothing(tmp_path):
    def work(case):
        if case["number"] == 1 and not (tmp_path / "killed").exists():
            (tmp_path / "killed").touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return {"square": case["number"] ** 2, "process": os.getpid()}

    with cluster_of(2) as found:
        records = run_campaign(work, CASES, config={}, scheduler=found)
    assert [record["result"]["square"] for record in records] == [0, 1, 4, 9]
    assert os.getpid() not in {record["result"]["process"] for record in records}


def test_workers_of_several_threads_are_refused_before_work():
    with (
        cluster_of(1, threads=2) as found,
        pytest.raises(ValueError, match=r"one thread each; .* has 2"),
    ):
        run_campaign(dict, CASES, config={}, scheduler=found)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "no address", "http://127.0.0.1:1"])
def test_a_scheduler_that_does_not_answer_is_one_line(address, monkeypatch, capsys):
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    monkeypatch.setattr(cluster, "client", partial(cluster.client, patience=0.2))
    assert run(["reproduce", "robustness", "--scheduler", address]) == 2
    err = capsys.readouterr().err
    said = f"--scheduler: no Dask scheduler answers at '{address}'."
    assert err.splitlines()[-1] == f"np-drake reproduce robustness: {said}"


def test_what_accepts_a_connection_and_says_nothing_is_no_scheduler():
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    with socket.create_server(("127.0.0.1", 0)) as silent:
        dut = cluster.client(f"tcp://127.0.0.1:{silent.getsockname()[1]}", patience=0.3)
        start = time.monotonic()
        with pytest.raises(ValueError, match="no Dask scheduler answers"), dut:
            pass
        assert time.monotonic() - start < 30.0


def test_a_scheduler_that_does_not_answer_leaves_no_thread():
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    before, dut = set(threading.enumerate()), cluster.client("tcp://127.0.0.1:1", patience=0.2)
    with pytest.raises(ValueError, match="no Dask scheduler answers"), dut:
        pass
    assert set(threading.enumerate()) <= before


def test_without_the_extra_it_is_one_line(monkeypatch, capsys):
    monkeypatch.setattr(cluster, "find_spec", lambda name: None)
    assert run(["reproduce", "robustness", "--scheduler", "tcp://127.0.0.1:1"]) == 2
    assert "pip install 'np_drake[cluster]'" in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize("status", ["lost", "pending"])
def test_an_answer_that_its_dead_worker_took_along_is_asked_for_again(status):
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    assert isinstance(cluster._outcome(SimpleNamespace(status=status)), DeadProcess)


def test_a_case_that_the_scheduler_drops_ends_in_one_line():
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    with pytest.raises(FailedRun, match="is the cluster still there"):
        cluster._outcome(SimpleNamespace(status="cancelled"))
