"""Laws of where cases run and what they cost."""

import pytest

from diagrams.batch.failed_run import FailedRun
from diagrams.batch.workers import Workers, duration, every_result, failures, results

DONE = {"case": {"seed": 1}, "result": {"E": 0.1}, "seconds": 6.0}
LOST = {
    "case": {"row": "np", "model": "", "values": [1], "seed": 2},
    "error": "lost: its process died",
    "seconds": None,
}


def test_the_cost_is_that_of_all_campaigns_of_a_run():
    dut = Workers(jobs=1)
    assert dut.cost() == []
    for numbers in ((1, 2), (3,)):
        dut.run(lambda case: {}, [{"number": k} for k in numbers], config={})
    assert len(dut.finished) == 3
    assert dut.cost()[0].startswith("processor time of 3 cases: ")


def test_the_cost_counts_what_failed_and_names_median_and_most():
    dut = Workers(finished=[DONE, DONE | {"seconds": 600.0}, DONE | {"seconds": 60.0}, LOST])
    said = (
        "processor time of 3 cases: 11.1 min; of a case: median 60 s, most 10 min; cases "
        "that failed: 1"
    )
    assert dut.cost() == [said]


@pytest.mark.parametrize(
    "seconds, text", [(0.5, "0.5 s"), (119.0, "119 s"), (120.0, "2 min"), (9000.0, "2.5 h")]
)
def test_a_duration_has_the_unit_that_suits_it(seconds, text):
    assert duration(seconds) == text


def test_a_case_without_a_result_is_a_line_and_loses_no_other():
    assert results([DONE, LOST]) == [{"E": 0.1}]
    assert failures([DONE, LOST]) == ["np, seed 2: lost: its process died"]


def test_where_no_case_has_a_result_the_run_has_failed():
    assert results([]) == []
    with pytest.raises(FailedRun, match="no case has a result; the first: lost: its process died"):
        results([LOST, LOST])


def test_a_table_that_needs_every_case_fails_with_the_first_that_is_lost():
    assert every_result([DONE, DONE]) == [{"E": 0.1}, {"E": 0.1}]
    with pytest.raises(
        FailedRun, match=r"^np, seed 2: lost: its process died \(1 of 2 cases failed\)$"
    ):
        every_result([DONE, LOST])
