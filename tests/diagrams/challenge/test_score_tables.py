"""Laws of a score's tables and of its figure."""

import pytest

from diagrams.challenge.score import score
from diagrams.challenge.score_tables import asked_tables, missed, tables
from tests.diagrams.challenge import hand_made as by_hand


@pytest.mark.parametrize("perfect", [True, False])
def test_tables_are_full_rows_and_every_miss_is_listed(perfect):
    lost = by_hand.make_case(by_hand.make_truth(by_hand.SCALE), None)
    dut = score(by_hand.perfect_set() if perfect else [lost])
    for _, header, rows in [*tables(dut, 1.5), *missed(dut)]:
        assert all(len(row) == len(header) for row in rows)
    assert [len(rows) for _, _, rows in missed(dut)] == ([] if perfect else [1])


def test_what_falls_short_of_what_is_asked_stands_between_asterisks():
    cases = [by_hand.again(c, truth={**c.truth, "quality": "real"}) for c in by_hand.perfect_set()]
    pair = next(c.truth for c in cases if c.kind == "pair")
    cases += [by_hand.named(pair, "thrust_scale", "linear_drag", unknown=True)]
    control = {**cases[0].truth, "kind": "clean", "effects": [], "class": []}
    cases += [by_hand.named(control, "mass_error")]
    ((_, header, rows),) = asked_tables(score(cases))
    assert header == ["figure", "asked", "real"]
    found = {row[0]: row[1:] for row in rows}
    assert found["single: right class"] == ("≥ 0.88", "100 % [75, 100] 13/13")
    assert found["`unknown` added to them"] == ("≤ 0.1", "**33 % [1, 91] 1/3**")
    assert found["clean controls: false alarm"] == ("≤ 0.03", "**50 % [1, 99] 1/2**")
    assert found["in the 95 % interval"] == ("0.88 … 0.99", "**100 % [89, 100] 32/32**")
