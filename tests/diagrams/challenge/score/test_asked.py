"""Laws of what is asked for beside what a score has."""

import dataclasses as dc

import pytest

from diagrams.challenge.score.asked import ASKED, Asked, asked_tables
from diagrams.challenge.score.score import score
from diagrams.challenge.score.tables import at
from np_drake.files.atomic_file import plain


@pytest.mark.parametrize(
    "value, text",
    [
        ({"count": 98, "n": 100}, "98/100"),
        ({"count": 97, "n": 100}, "**97/100**"),
        ({"count": 0, "n": 0}, "–"),
        (0.98, "0.98"),
        (0.97, "**0.97**"),
        (None, "–"),
    ],
    ids=str,
)
def test_what_is_asked_for_is_enough_and_no_cases_fall_short_of_nothing(value, text):
    dut = Asked("x", "x", clean=(0.98, float("inf")))
    assert dut.cells("clean", value) == ("x", "≥ 0.98", text)
    assert dut.cells("real", value) == ("x", "–", text.strip("*"))


def test_every_figure_is_one_of_the_score(by_hand):
    whole = plain(score(by_hand.perfect_set()))
    figures = {figure.label: at(whole, figure.keys) for figure in ASKED}
    assert (figures["single: right class"]["count"], figures["single: right class"]["n"]) == (
        13,
        13,
    )
    assert figures["shrink, mean"] == 1.0
    assert figures["parameters: median error"] == 0.0


def test_one_simulator_in_two_qualities_has_figures_of_each(by_hand):
    cases = by_hand.perfect_set()
    noisy = [
        dc.replace(c, truth={**c.truth, "quality": "real", "seed": 7}, name=f"again {c.name}")
        for c in cases
    ]
    ((_, _, alone),) = asked_tables(score(cases))
    (_, one, clean), (_, other, real) = asked_tables(score([*cases, *noisy]))
    assert (one[2], other[2]) == ("clean", "real")
    assert clean == alone
    assert [row[2].strip("*") for row in real] == [row[2].strip("*") for row in alone]


def test_what_is_asked_of_wild_sets_is_shown_beside_what_they_have(by_hand):
    cases = [dc.replace(c, truth={**c.truth, "quality": "wild"}) for c in by_hand.perfect_set()]
    pair = next(c.truth for c in cases if c.kind == "pair")
    cases += [by_hand.named(pair, "thrust_scale", "linear_drag", unknown=True)]
    cases += [
        by_hand.named({**cases[0].truth, "kind": "clean", "effects": [], "class": []}, "mass_error")
    ]
    ((_, header, rows),) = asked_tables(score(cases))
    assert header == ["figure", "asked", "wild"]
    assert {row[0]: row[1:] for row in rows} == {
        "single: right class": ("≥ 0.85", "13/13"),
        "`unknown` added to them": ("≤ 0.1", "**1/3**"),
        "clean controls: false alarm": ("≤ 0.02", "**1/2**"),
        "foreign: `unknown`": ("≥ 0.85", "1/1"),
        "in the 95 % interval": ("0.9 … 0.98", "**32/32**"),
        "calibration error": ("≤ 0.05", "0.0435"),
    }
