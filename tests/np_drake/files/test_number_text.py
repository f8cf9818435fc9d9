"""Laws of numbers and sentences as text."""

import pytest

from np_drake.files.number_text import grouped

TOLD = [  # lines, and what is left of them
    ("a: no wind.|b: no wind.|a: no wind.|none.", "a, b: no wind.|none."),
    ("a: 2.9 mrad over 5 s.|b: 3.1 mrad over 5 s.", "a, b: 2.9 / 3.1 mrad over 5 s."),
    ("a: row 3|a: row #|a: row ", "a: row 3|a: row #|a: row "),  # any text may stand for a number
    ("a: u1 is empty.|a: u2 is empty.", "a: u1 is empty.|a: u2 is empty."),  # part of a name
]


@pytest.mark.parametrize("lines, told", TOLD)
def test_sentences_of_several_flights_or_numbers_are_said_once(lines, told):
    assert grouped(lines.split("|"), ["a", "b"]) == told.split("|")
