"""Laws of numbers and names as text."""

import math

import pytest

from np_drake.diagnosis.report import words as dut
from np_drake.diagnosis.result import Estimate


@pytest.mark.parametrize(
    "value, text",
    [
        (0.26041, "0.260"),
        (-0.0012, "−0.00120"),
        (1234.4, "1234"),
        (0.0, "0"),
        (3.2e-7, "3.20 × 10⁻⁷"),
        (float("nan"), "–"),
        (float("inf"), "–"),
        (None, "–"),
    ],
)
def test_a_number_has_three_significant_digits(value, text):
    assert dut.number(value) == text


@pytest.mark.parametrize(
    "share, text",
    [
        (0.5, "50 %"),
        (0.9999, "> 99.9 %"),
        (1.0, "100 %"),
        (0.998, "99.8 %"),
        (1e-9, "< 0.1 %"),
        (-0.2, "−20 %"),
    ],
)
def test_a_share_is_never_rounded_to_certainty(share, text):
    assert dut.percent(share).replace("\u00a0", " ") == text


def test_nothing_inferred_is_certain():
    assert dut.probability(1.0) == "> 99.9\u00a0%"
    assert dut.probability(0.0) == "< 0.1\u00a0%"
    assert dut.percent_interval((0.93, 1.02)) == "93 … 100\u00a0%"


def test_an_estimate_has_the_digits_that_its_interval_warrants():
    assert dut.estimate(Estimate(0.26041, "kg", (0.2551, 0.2658))) == ("0.260", "0.255 … 0.266")
    assert dut.estimate(Estimate(3.0, "1", (float("nan"), float("nan")))) == ("3.00", "–")


def test_names_are_listed_as_one_says_them():
    assert dut.listed(["a"]) == "a"
    assert dut.listed(["a", "b", "c"]) == "a, b and c"
    assert dut.listed(["a", "b"], "or") == "a or b"


def test_a_users_own_effect_keeps_its_identifier():
    assert dut.name_of("sticky_rotor") == "sticky rotor"
    assert dut.title_of("suspended_payload") == "Suspended payload"


def test_a_file_name_for_a_figure_is_short_and_has_signs_that_fonts_have():
    assert dut.plain_name("train_1.csv") == "train_1.csv"
    assert dut.plain_name("飞\n行") == "???"
    assert len(dut.plain_name("x" * 300)) == 36


def test_an_effect_that_is_absent_from_a_flight_has_no_time():
    assert dut.onset(8.0, "a").replace(dut.NBSP, " ") == "at 8.00 s in a"
    assert dut.onset(math.inf, "a") == "not in a"


def test_a_choice_is_a_whole_number_without_an_interval():
    assert dut.estimate(Estimate(4.0, "", (4.0, 4.0))) == ("4", dut.NOTHING)


def test_an_interval_of_a_share_ends_at_all_of_it():
    assert dut.percent_interval((1.01, 1.04)).replace(dut.NBSP, " ") == "100 … 100 %"
