"""Laws of tables and sentences on a terminal."""

import pytest

from diagrams.cli import table_text as dut

WORDS = (
    "a sentence of many words with 0.251 N·s/m in it, 12 % of them and 3.4 kg·m² more, that "
    "is told at length"
)


@pytest.mark.parametrize("width", range(20, 60))
def test_a_line_breaks_between_words_and_never_before_a_unit(width):
    lines = dut.wrapped(WORDS, width)
    assert " ".join(lines) == WORDS
    assert max(map(len, lines)) <= width
    assert not any(line.startswith(("N·s/m", "% ", "kg·m²")) for line in lines)


@pytest.mark.parametrize("width", [40, 60, 80])
def test_a_table_fits_and_breaks_no_word(width):
    header = ["cause", "probability", "parameter", "value", "95 % interval", "begins", "or else"]
    row = (
        "suspended_payload",
        "> 99.9 %",
        "time_constant",
        "0.251 N·s/m",
        "0.243 to 0.260",
        "9.1 s",
        "command_delay",
    )
    lines = dut.table_lines("causes", header, [row], width)
    assert max(map(len, lines)) <= width
    shown = " ".join(" ".join(lines).split())
    for word in (*row[:4], *row[5:], "0.243", "0.260"):
        assert word in shown


def test_numbers_stand_to_the_right_with_three_digits_and_no_exponent():
    lines = dut.table_lines(
        "skill", ["model", "n", "force"], [("np", 3, 1234.5), ("hold", 12, 2.9e-7)], 80
    )
    assert lines[3:] == ["np      3         1234", "hold   12  2.90 × 10⁻⁷"]


def test_one_column_of_text_is_a_list():
    lines = dut.table_lines("steps", ["step"], [("fly more and then again",), ("rest",)], 16)
    assert lines == ["steps", "- fly more and", "  then again", "- rest"]
