"""Laws of work in several processes. The work is defined inside the tests, so that it travels by
value.
"""

import os
import signal
import sys
import time
import warnings

import numpy as np
import pytest

from diagrams.batch.processes import DeadProcess, as_they_finish


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_case_has_its_value_from_another_process(jobs):
    dut = dict(as_they_finish(lambda case: (case**2, os.getpid()), [3, 1, 2], jobs))
    assert {number: square for number, (square, _) in dut.items()} == {0: 9, 1: 1, 2: 4}
    assert os.getpid() not in {process for _, process in dut.values()}


@pytest.mark.parametrize("jobs", [1, 2])
def test_no_more_cases_are_at_work_than_there_are_jobs(jobs, tmp_path):
    def work(case):
        (tmp_path / f"{case}").touch()
        at_work = len(list(tmp_path.iterdir()))
        time.sleep(0.05)
        (tmp_path / f"{case}").unlink()
        return at_work

    assert max(dict(as_they_finish(work, range(6), jobs)).values()) <= jobs


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_the_work_raises_reaches_the_caller(jobs):
    def work(case):
        if case == 1:
            raise ValueError("mass must be positive")
        return case

    with pytest.raises(ValueError, match="mass must be positive"):
        list(as_they_finish(work, [0, 1, 2], jobs))


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
    assert [isinstance(dut[case], DeadProcess) for case in range(6)] == [
        case in (1, 4) for case in range(6)
    ]
    assert "EXIT(7)" in str(dut[1])
    assert "SIGKILL" in str(dut[4])
    tries = {path.name: len(path.read_text().split()) for path in tmp_path.iterdir()}
    assert len(tries) == 6
    assert tries["1"] in (2, 3)  # once beside others, perhaps again as another died, once alone


def test_a_process_that_grew_is_replaced_without_a_word():
    def work(case):
        sys.grown = np.ones(50_000_000 if case else 0)  # 400 MB; loky lets a process grow by less
        time.sleep(1.1)  # it looks at its size at most once a second
        return case

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        dut = dict(as_they_finish(work, range(4), jobs=1))
    assert dut == {n: n for n in range(4)}
    assert not told


def test_a_campaign_that_ends_early_says_nothing():
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        dut = as_they_finish(lambda case: time.sleep(0.2 * case), range(6), 2)
        next(dut)
        dut.close()
    assert not told
