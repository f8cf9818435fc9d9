"""Laws of work in several processes. The work is defined inside the tests, so that it travels by value."""

import os
import signal
import subprocess
import sys
import time
import warnings

import numpy as np
import pytest

from diagrams.batch.processes import DeadProcess, as_they_finish, in_order


@pytest.mark.parametrize("jobs", [1, 2])
def test_values_come_in_the_order_of_the_cases(jobs):
    seen = []
    dut = in_order(
        lambda case: case**2, [3, 1, 2], jobs=jobs, on_progress=lambda *counts: seen.append(counts)
    )
    assert dut == [9, 1, 4]
    assert seen == [(1, 3), (2, 3), (3, 3)]


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_the_work_raises_reaches_the_caller(jobs):
    def work(case):
        if case == 1:
            raise ValueError("mass must be positive")
        return case

    with pytest.raises(ValueError, match="mass must be positive"):
        in_order(work, [0, 1, 2], jobs=jobs)


def test_processes_that_die_lose_their_own_cases_only(tmp_path):
    def work(case):
        with (tmp_path / f"{case}").open("a") as file:
            file.write("tried\n")
        if case == 1:
            os._exit(7)
        if case == 4:
            os.kill(os.getpid(), signal.SIGKILL)
        return os.getpid()

    dut = dict(as_they_finish(work, range(6), jobs=2))
    assert sorted(dut) == list(range(6))
    assert [isinstance(dut[case].error, DeadProcess) for case in range(6)] == [
        case in (1, 4) for case in range(6)
    ]
    assert "EXIT(7)" in str(dut[1].error)
    assert "SIGKILL" in str(dut[4].error)
    tries = {path.name: len(path.read_text().split()) for path in tmp_path.iterdir()}
    assert len(tries) == 6
    assert tries["1"] in (2, 3)  # once beside others, perhaps again as another died, once alone
    with pytest.raises(DeadProcess):
        dut[1].unwrap()


def test_a_process_that_grew_is_replaced_without_a_word():
    def work(case):
        sys.grown = np.ones(50_000_000 if case else 0)  # 400 MB; loky lets a process grow by less
        time.sleep(1.1)  # it looks at its size at most once a second
        return case

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        dut = dict(as_they_finish(work, range(4), jobs=1, isolated=True))
    assert {number: outcome.unwrap() for number, outcome in dut.items()} == {n: n for n in range(4)}
    assert not told


def test_isolated_work_never_runs_in_this_process():
    ((_, dut),) = as_they_finish(lambda _: os.getpid(), [0], jobs=1, isolated=True)
    assert dut.unwrap() != os.getpid()


def test_one_process_alone_loads_nothing_for_more():
    program = "import sys; from diagrams.batch.processes import in_order; in_order(abs, [1], jobs=1)"
    program += "; print('joblib' in sys.modules)"
    dut = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert dut.stdout.strip() == "False"
