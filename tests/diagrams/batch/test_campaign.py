"""Laws of campaigns. The work is defined inside the tests, so that it travels by value."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from diagrams.batch import campaign
from diagrams.batch.campaign import case_file, run_campaign

CONFIG = {"solver": "sqp", "reality": {"drag": 0.25}}
CASES = [{"row": "np", "speed": speed} for speed in (0.5, 1.0, 1.5)]


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
    ("how", "why"), [("exit", "EXIT(5)"), ("raise", "KeyError: 'drag' (test_campaign.py:")]
)
def test_a_failed_case_is_alone_is_recorded_and_is_tried_again(counted, tmp_path, how, why):
    work, calls, broken = counted
    broken.write_text(how)
    folder = tmp_path / "cases"
    first = run_campaign(work, CASES, config=CONFIG, folder=folder, jobs=1)
    assert [record["case"] for record in first] == CASES
    assert ["error" in record for record in first] == [False, True, False]
    assert why in first[1]["error"]
    assert why in json.loads((folder / case_file(CASES[1])).read_text())["error"]
    broken.unlink()
    second = run_campaign(work, CASES, config=CONFIG, folder=folder, jobs=1)
    tries = (
        2 if how == "exit" else 1
    )  # a dead process gets another; what is raised would be raised again
    assert sorted(calls()) == ["0.5", *(1 + tries) * ["1.0"], "1.5"]
    assert second[1]["result"] == {"E_xy": 0.1, "growth": 1.0}
    assert [second[0], second[2]] == [
        first[0],
        first[2],
    ]  # from the files as from the work, NaN included
    assert second[2]["result"]["growth"] is None


def test_a_finished_campaign_starts_no_process(counted, tmp_path, monkeypatch):
    work, *_ = counted
    records = run_campaign(work, CASES[:1], config=CONFIG, folder=tmp_path / "cases")
    monkeypatch.setattr(campaign, "as_they_finish", None)
    seen = []
    again = run_campaign(
        work,
        CASES[:1],
        config=CONFIG,
        folder=tmp_path / "cases",
        on_progress=lambda *counts: seen.append(counts),
    )
    assert again == records
    assert seen == [(1, 1)]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"config": {"solver": "sqp", "reality": {"drag": 0.5}}},
            "config.reality.drag is 0.5, .* 0.25; choose",
        ),
        ({"version": "9.9"}, "version is .9.9"),
        ({"case": {"row": "gp"}}, "its content is of none"),
    ],
)
def test_the_file_of_another_campaign_is_refused_and_kept(tmp_path, monkeypatch, change, message):
    path = tmp_path / case_file(CASES[0])
    head = {"schema": campaign.SCHEMA, "version": campaign.version("np_drake"), "config": CONFIG}
    content = {**head, "case": CASES[0], "result": {}, "seconds": 1.0}
    text = json.dumps(content | change)
    path.write_text(text)
    monkeypatch.setattr(campaign, "as_they_finish", None)
    with pytest.raises(ValueError, match=message) as caught:
        run_campaign(dict, CASES, config=CONFIG, folder=tmp_path)
    assert str(path) in str(caught.value)
    assert [p.read_text() for p in tmp_path.iterdir()] == [text]


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_case_whose_file_was_cut_off_is_run_again(counted, tmp_path, share):
    work, calls, _ = counted
    folder = tmp_path / "cases"
    first = run_campaign(work, CASES[:1], config=CONFIG, folder=folder)
    (path,) = folder.iterdir()
    text = path.read_text()
    path.write_text(text[: int(share * len(text))])
    again = run_campaign(work, CASES[:1], config=CONFIG, folder=folder)
    assert calls() == ["0.5", "0.5"]
    assert again[0]["result"] == first[0]["result"]
    assert json.loads(path.read_text())["result"] == first[0]["result"]


def test_cases_that_repeat_are_refused():
    with pytest.raises(ValueError, match="differ from each other"):
        run_campaign(dict, [{"a": 1, "b": 2}, {"b": 2, "a": 1}], config={})


def test_an_answer_that_json_does_not_know_fails_its_case_alone():
    records = run_campaign(lambda case: {"answer": case["make"]()}, [{"make": "x"}], config={})
    assert "TypeError" in records[0]["error"]


def test_a_process_that_dies_once_costs_nothing(tmp_path):
    def work(case):
        if case["speed"] == 1.0 and not (tmp_path / "died").exists():
            (tmp_path / "died").touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return {"twice": 2 * case["speed"]}

    records = run_campaign(work, CASES, config={}, jobs=2)
    assert [record["result"]["twice"] for record in records] == [1.0, 2.0, 3.0]


def test_what_is_kept_of_a_result_is_decided_here_and_only_once(tmp_path):
    seen = []

    def keep(case, result):
        seen.append((os.getpid(), result["large"]))
        return {"small": case["speed"]}

    def work(case):
        return {"large": [case["speed"]] * 3}

    for _ in range(2):
        records = run_campaign(work, CASES, config={}, folder=tmp_path, keep=keep)
        assert [record["result"] for record in records] == [{"small": s} for s in (0.5, 1.0, 1.5)]
    assert sorted(seen) == [(os.getpid(), [s] * 3) for s in (0.5, 1.0, 1.5)]


def test_the_time_of_a_case_holds_that_of_the_programs_it_starts():
    def work(case):
        program = "import time\nwhile time.process_time() < 0.4: pass"
        subprocess.run([sys.executable, "-c", program], check=True)
        return {}

    (record,) = run_campaign(work, CASES[:1], config={})
    assert record["seconds"] > 0.4  # [s]


def test_a_worker_of_another_version_says_so(monkeypatch):
    guarded = campaign.Guarded(dict)
    monkeypatch.setattr(campaign, "version", lambda name: "9.9")
    assert "np_drake must be" in guarded({})["error"]


KILLED = """
import sys, time
from pathlib import Path
from diagrams.batch.campaign import run_campaign

folder = Path(sys.argv[1])

def work(case):
    time.sleep(0.03)
    return {"square": case["k"] ** 2}

run_campaign(work, [{"k": k} for k in range(30)], config={}, folder=folder, jobs=1)
(folder.parent / "whole").touch()
"""


def test_a_campaign_killed_at_any_time_loses_and_doubles_no_case(tmp_path):
    folder, rng, runs = tmp_path / "cases", np.random.default_rng(3), 0
    while not (tmp_path / "whole").exists():
        command = [sys.executable, "-c", KILLED, str(folder)]
        process = subprocess.Popen(command, start_new_session=True, stderr=subprocess.DEVNULL)
        runs += 1
        if runs > 6:  # so that the test ends
            process.wait()
            continue
        before = len([*folder.glob("*.json")]) if folder.exists() else 0
        while process.poll() is None and len([*folder.glob("*.json")]) < before + 2:
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, 0.1))
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert runs > 3
    cases = [{"k": k} for k in range(30)]
    # A kill within a write may leave its hidden temporary file, which no run reads.
    assert {path.name for path in folder.glob("[!.]*.json")} == {case_file(case) for case in cases}
    campaign_again = run_campaign(
        dict, cases, config={}, folder=folder
    )  # from the files: `dict` would say k
    assert [record["result"] for record in campaign_again] == [{"square": k**2} for k in range(30)]
