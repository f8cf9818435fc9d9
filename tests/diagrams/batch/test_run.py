"""Laws of campaigns. The work is defined inside the tests, so that it travels by value."""

import contextlib
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from diagrams.batch import run as campaign
from diagrams.batch.run import FailedRun, Workers, every_result, failures, results

CONFIG = {"solver": "sqp", "reality": {"drag": 0.25}}
CASES = [{"row": "np", "speed": speed} for speed in (0.5, 1.0, 1.5)]
DONE = {"case": {"seed": 1}, "result": {"E": 0.1}, "seconds": 6.0}
LOST = {"case": {"row": "np", "seed": 2}, "error": "lost: its process died", "seconds": None}


@pytest.fixture
def counted(tmp_path):
    """Work that leaves a line a call, fails at 1.0 while `broken` says how, and answers NaN at
    1.5.
    """
    calls, broken = tmp_path / "calls", tmp_path / "broken"
    calls.touch()

    def work(case):
        with calls.open("a") as file:
            file.write(f"{case['speed']}\n")
        if case["speed"] == 1.0 and broken.exists():
            if broken.read_text() == "exit":
                os._exit(5)
            raise KeyError("drag")
        return {"E_xy": case["speed"] / 10, "growth": float("nan" if case["speed"] == 1.5 else 1)}

    return work, lambda: calls.read_text().split(), broken


@pytest.mark.parametrize(
    ("how", "why"), [("exit", "EXIT(5)"), ("raise", "KeyError: 'drag' (test_run.py:")]
)
def test_a_failed_case_is_alone_is_recorded_and_is_tried_again(counted, tmp_path, how, why):
    work, calls, broken = counted
    broken.write_text(how)
    folder = tmp_path / "cases"
    first = Workers(folder=folder).run(work, CASES, config=CONFIG)
    assert [record["case"] for record in first] == CASES
    assert ["error" in record for record in first] == [False, True, False]
    assert why in first[1]["error"]
    broken.unlink()
    before = len(calls())
    second = Workers(folder=folder).run(work, CASES, config=CONFIG)
    assert calls()[before:] == ["1.0"]
    assert second[1]["result"] == {"E_xy": 0.1, "growth": 1.0}
    assert [second[0], second[2]] == [first[0], first[2]]  # from the files, NaN included
    assert second[2]["result"]["growth"] is None


def test_a_finished_campaign_starts_no_process_and_another_one_does(counted, tmp_path, monkeypatch):
    work, calls, _ = counted
    workers, seen = Workers(folder=tmp_path / "cases"), []
    records = workers.run(work, CASES[:1], config=CONFIG)
    workers.run(work, CASES[:1], config={"solver": "ipopt"})
    assert len(calls()) == 2
    monkeypatch.setattr(campaign, "_together", None)
    again = workers.run(work, CASES[:1], config=CONFIG, on_progress=lambda *n: seen.append(n))
    assert again == records
    assert seen == [(1, 1)]


def test_cases_that_repeat_are_refused():
    with pytest.raises(ValueError, match="differ from each other"):
        Workers().run(dict, [{"a": 1, "b": 2}, {"b": 2, "a": 1}], config={})


def test_what_is_kept_of_a_result_is_decided_here_and_only_once(tmp_path):
    seen = []

    def keep(case, result):
        seen.append((os.getpid(), result["large"]))
        return {"small": case["speed"]}

    def work(case):
        return {"large": [case["speed"]] * 3}

    for _ in range(2):
        records = Workers(folder=tmp_path).run(work, CASES, config={}, keep=keep)
        assert [record["result"] for record in records] == [{"small": s} for s in (0.5, 1.0, 1.5)]
    assert sorted(seen) == [(os.getpid(), [s] * 3) for s in (0.5, 1.0, 1.5)]


def test_a_worker_of_another_version_says_so():
    assert "np_drake must be 9.9" in campaign._guarded(dict, "9.9", {})["error"]


KILLED = """
import sys, time
from pathlib import Path
from diagrams.batch.run import Workers

folder = Path(sys.argv[1])

def work(case):
    import numpy as np
    time.sleep(0.03)
    return {"sum": float(np.random.default_rng(case["k"]).standard_normal(1000).sum())}

Workers(folder=folder).run(work, [{"k": k} for k in range(12)], config={})
(folder.parent / "whole").touch()
"""


def test_a_campaign_killed_at_any_time_loses_and_doubles_no_case(tmp_path):
    folder, rng, runs = tmp_path / "cases", np.random.default_rng(3), 0
    while not (tmp_path / "whole").exists():
        command = [sys.executable, "-c", KILLED, str(folder)]
        process = subprocess.Popen(command, start_new_session=True, stderr=subprocess.DEVNULL)
        runs += 1
        if runs > 2:  # so that the test ends
            process.wait()
            continue
        before = len([*folder.glob("*.json")]) if folder.exists() else 0
        while process.poll() is None and len([*folder.glob("*.json")]) < before + 2:
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, 0.1))
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    cases = [{"k": k} for k in range(12)]
    # A kill within a write may leave its hidden temporary file, which no run reads.
    assert len({path.name for path in folder.glob("[!.]*.json")}) == len(cases)
    again = Workers(folder=folder).run(dict, cases, config={})  # from the files
    sums = [float(np.random.default_rng(k).standard_normal(1000).sum()) for k in range(12)]
    assert [record["result"]["sum"] for record in again] == sums


def test_a_run_counts_the_cost_of_all_its_campaigns():
    dut = Workers(jobs=1)
    assert dut.cost() == []
    for numbers in ((1, 2), (3,)):
        dut.run(lambda case: {}, [{"number": k} for k in numbers], config={})
    assert dut.cost()[0].startswith("processor time of 3 cases: ")
    assert Workers(finished=[DONE, LOST]).cost()[0].endswith("6 s; cases that failed: 1")


def test_a_case_without_a_result_is_a_line_and_loses_no_other():
    assert results([DONE, LOST]) == [{"E": 0.1}]
    assert failures([DONE, LOST]) == ["np, 2: lost: its process died"]
    assert results([]) == []
    with pytest.raises(FailedRun, match="no case has a result; the first: lost: its process died"):
        results([LOST, LOST])
    with pytest.raises(FailedRun, match=r"^np, 2: lost: its process died \(1 of 2 cases failed\)$"):
        every_result([DONE, LOST])
