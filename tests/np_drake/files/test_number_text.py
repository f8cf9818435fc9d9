"""Laws of numbers and sentences as text."""

from np_drake.files.number_text import grouped


def test_what_is_said_of_several_flights_is_said_once():
    lines = ["a.csv: no velocity.", "b.csv: no velocity.", "a.csv: no velocity.", "no wind."]
    dut = grouped(lines, ["a.csv", "b.csv"])
    assert dut == ["a.csv, b.csv: no velocity.", "no wind."]


def test_sentences_that_differ_in_numbers_alone_are_one():
    lines = [f"{name}: noise of {x} mrad over 5 s." for name, x in (("a", 2.9), ("b", 3.1))]
    assert grouped(lines, ["a", "b"]) == ["a, b: noise of 2.9 / 3.1 mrad over 5 s."]


def test_any_text_can_stand_where_another_line_has_a_number():
    assert grouped(["a: row 3", "a: row #", "a: row "], ["a"]) == [
        "a: row 3",
        "a: row #",
        "a: row ",
    ]


def test_numbers_that_are_part_of_a_name_tell_sentences_apart():
    lines = ["a: column u1 is empty.", "a: column u2 is empty.", "c: column u1 is empty."]
    assert grouped(lines, ["a"]) == lines
