"""Laws of the verbs that fly several seeds."""

from types import SimpleNamespace

import pytest

from diagrams.batch.flown import FlownOptions, FlownRun, choose_rows
from diagrams.batch.run import Run

ROWS = tuple(SimpleNamespace(name=name) for name in ("nominal", "hold", "np"))


def test_evaluation_seeds_follow_the_training_seed(tmp_path):
    dut = FlownRun.of(Run(40, scratch=tmp_path), FlownOptions(seeds=3))
    assert dut.settings == {"solver": "sqp", "seeds": [41, 42, 43], "training_seed": 40}
    assert dut.title() == "3 flights a row, seeds 41 … 43, trained on seed 40, sqp"
    assert dut.title("hovers", "np ") == "3 hovers, seeds 41 … 43, np trained on seed 40, sqp"


def test_nominal_flies_with_every_choice_of_rows():
    assert choose_rows(ROWS, None) == ROWS
    assert [row.name for row in choose_rows(ROWS, ["np"])] == ["nominal", "np"]


def test_a_table_says_which_rows_it_cannot_do_without():
    assert [row.name for row in choose_rows(ROWS, ["np"], always=("hold",))] == ["hold", "np"]


def test_an_unknown_row_is_refused_with_those_there_are():
    with pytest.raises(
        ValueError, match=r"--only: must name rows of the table \(nominal; hold; np\); got pid"
    ):
        choose_rows(ROWS, ["np", "pid"])
