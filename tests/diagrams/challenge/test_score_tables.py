"""Laws of a score's tables and of its figure."""

import pytest

from diagrams.challenge.score import score
from diagrams.challenge.score_tables import missed, tables
from tests.diagrams.challenge import hand_made as by_hand


@pytest.mark.parametrize("perfect", [True, False])
def test_tables_are_full_rows_and_every_miss_is_listed(perfect):
    lost = by_hand.make_case(by_hand.make_truth(by_hand.SCALE), None)
    dut = score(by_hand.perfect_set() if perfect else [lost])
    for _, header, rows in [*tables(dut, 1.5), *missed(dut)]:
        assert all(len(row) == len(header) for row in rows)
    assert [len(rows) for _, _, rows in missed(dut)] == ([] if perfect else [1])
