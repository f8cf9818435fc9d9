import pytest

from diagrams.challenge.score.figures import figures
from diagrams.challenge.score.score import score
from diagrams.challenge.score.tables import miss_table, share, tables
from np_drake.files.figure_file import png


def test_every_figure_is_drawn(by_hand):
    made = figures(score(by_hand.perfect_set()))
    assert sorted(made) == ["confusion.png", "detection.png", "effects.png", "reliability.png"]
    assert all(png(draw()).startswith(b"\x89PNG") for draw in made.values())


def test_a_set_of_clean_controls_has_no_figure_but_the_matrix(by_hand):
    dut = score([by_hand.named(by_hand.make_truth(kind="clean"))])
    assert list(figures(dut)) == ["confusion.png"]


@pytest.mark.parametrize("perfect", [True, False])
def test_tables_are_full_rows(by_hand, perfect):
    cases = (
        by_hand.perfect_set()
        if perfect
        else [by_hand.make_case(by_hand.make_truth(by_hand.SCALE), None)]
    )
    dut = score(cases)
    for _, header, rows in [*tables(dut, 1.5), miss_table(dut)]:
        assert all(len(row) == len(header) for row in rows)
    assert len(miss_table(dut)[2]) == (0 if perfect else 1)


def test_a_share_shows_interval_and_counts():
    assert share({"count": 1, "n": 2, "rate": 0.5, "ci95": [0.0126, 0.9874]}) == "50 % [1, 99] 1/2"
    assert share({"count": 0, "n": 0, "rate": None, "ci95": [0.0, 1.0]}) == "–"
