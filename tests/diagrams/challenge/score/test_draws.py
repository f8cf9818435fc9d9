"""Laws of draws side by side."""

import dataclasses as dc
import json
from pathlib import Path

import pytest

from diagrams.challenge.score.draws import (
    METRICS,
    Metric,
    asked_table,
    draw_of,
    name_of,
    number,
    read_draws,
    share,
    table,
    together,
)
from diagrams.challenge.score.score import score
from diagrams.cli.main import run
from np_drake.files.atomic_file import plain

STUDIES = Path(__file__).parents[4] / "docs" / "studies"


SCORED = json.dumps(
    {
        "schema": "np_drake.challenge_score/1",
        "sets": [{"group": "drake, clean", "seeds": [1]}],
        "groups": {},
        "qualities": {},
        "rates": {
            "single": {"class": {"count": "$", "n": 1}, "exact": {"count": 1, "n": 1}},
            "several": {"all": {"f1": 1.0}, "unknown": {"count": 0, "n": 1}},
            "clean": {"false_alarm": {"count": 0, "n": 1}},
            "foreign": {"unknown": {"count": 1, "n": 1}, "wrong_and_sure": {"count": 0, "n": 1}},
        },
        "parameters": {"median_error": 0.1, "coverage_rate": {"count": 1, "n": 1}},
        "onset": {name: {"count": 1, "n": 1} for name in ("within", "within_if_seen", "within_if_told")},
        "shrink_relative": {"mean": 1.0},
        "shrink_relative_parameters": {"mean": 1.0},
        "detection": {"half": 1.0},
        "reliability": {"ece": 0.01},
        "replay": {"median_reduction": 0.9},
    }
).replace('"$"', "$")


@pytest.fixture
def whole(by_hand):
    return {"schema": "np_drake.challenge_score/1", **plain(score(by_hand.perfect_set()))}


def test_every_figure_is_one_of_the_score(whole):
    dut = draw_of(whole)
    assert dut["seeds"] == whole["sets"][0]["seeds"]
    (figures,) = [dut[name] for name in ("clean", "real") if name in dut]
    assert list(figures) == [figure.label for figure in METRICS]
    assert figures["single: right class"] == {"count": 13, "n": 13}
    assert figures["shrink, mean"] == {"value": 1.0}
    assert figures["parameters: median error"] == {"value": 0.0}


def test_figures_that_were_kept_are_those_of_the_scores(whole, tmp_path, capsys):
    files = [tmp_path / f"{name}.json" for name in ("score", "kept", "again")]
    files[0].write_text(json.dumps(whole))
    written = []
    for source, target in ((files[0], files[1]), (files[1], files[2])):
        page = target.with_suffix(".md")
        assert run(["challenge", "compare", str(source), "--json", str(target), "--markdown", str(page)]) == 0
        written.append(page.read_text())
    assert written[0] == written[1]
    assert (
        read_draws(files[:1]) == read_draws(files[1:]) == read_draws(files)
    )  # one draw, however often given


@pytest.mark.parametrize(
    "value, short",
    [({"count": 98, "n": 100}, False), ({"count": 97, "n": 100}, True), ({"count": 0, "n": 0}, False), ({}, False)],
    ids=str,
)  # fmt: skip
def test_what_is_asked_for_is_enough_and_no_cases_fall_short_of_nothing(value, short):
    dut = Metric("x", share(), clean=(0.98, float("inf")))
    assert dut.falls_short("clean", value) is short
    assert not dut.falls_short("real", value)


def test_together_is_of_all_cases_not_of_all_draws():
    values = [{"count": 1, "n": 1}, {"count": 0, "n": 3}, {}, {"value": 0.5}]
    assert number(together(values)) == 0.25
    assert together([{"value": 0.5}]) == {}


def test_short_figures_are_bold_and_draws_have_a_column_each():
    figures = {"single: right class": {"count": 1, "n": 2}, "shrink, mean": {"value": 0.96}}
    draws = [{"seeds": [5107, 5111], "clean": figures}, {"seeds": [3, 5107], "real": figures}]
    header, rows = table(draws, "clean")
    assert header == ["clean", "asked", "5xxx", "together"]
    assert [len(row) for row in rows] == [4] * len(METRICS)
    assert rows[0] == ["single: right class", "≥ 0.98", "**1/2**", "**1/2**"]
    assert [row[1:] for row in rows if row[0] == "shrink, mean"] == [["≥ 0.95", "0.96", "–"]]
    assert name_of(draws[1]) == "3, 5107"


def test_one_simulator_in_two_qualities_has_figures_of_each(by_hand):
    cases = by_hand.perfect_set()
    noisy = [dc.replace(c, truth={**c.truth, "quality": "real", "seed": 7}) for c in cases]
    kept = draw_of(plain(score(cases)))
    both = draw_of(plain(score([*cases, *[dc.replace(c, name=f"again {c.name}") for c in noisy]])))
    assert both["clean"] == both["real"] == kept["clean"]


def test_what_is_asked_of_wild_sets_is_shown_beside_what_they_have(by_hand):
    cases = [dc.replace(c, truth={**c.truth, "quality": "wild"}) for c in by_hand.perfect_set()]
    pair = next(c.truth for c in cases if c.kind == "pair")
    cases += [by_hand.named(pair, "thrust_scale", "linear_drag", unknown=True)]
    cases += [by_hand.named({**cases[0].truth, "kind": "clean", "effects": [], "class": []}, "mass_error")]
    ((_, header, rows),) = asked_table(score(cases), "wild")
    assert header == ["figure", "asked", "wild"]
    assert {row[0]: row[1:] for row in rows} == {
        "single: right class": ["≥ 0.85", "13/13"],
        "`unknown` added to them": ["≤ 0.1", "**1/3**"],
        "clean controls: false alarm": ["≤ 0.02", "**1/2**"],
        "foreign: `unknown`": ["≥ 0.85", "1/1"],
        "in the 95 % interval": ["0.9 … 0.98", "**32/32**"],
        "calibration error": ["≤ 0.05", "0.0435"],
    }


def test_nothing_is_asked_of_wild_sets_where_there_are_none(whole):
    assert asked_table(whole, "wild") == []


BAD = {
    "no JSON": ("nothing", "must be what `challenge score --json`"),
    "another verb": ('{"schema": "np_drake.bench/1"}', "must be what `challenge score --json`"),
    "half a score": ('{"schema": "np_drake.challenge_score/1", "sets": []}', "must be a whole score"),
    "parts that are a list": (
        '{"schema": "np_drake.challenge_score/1", "sets": [], "groups": {}, "qualities": [1]}',
        "must be a whole score",
    ),
    "a count of text": (SCORED.replace("$", '"x"'), "must be a whole score; clean.single: right class.count"),
    "a count beyond all": (SCORED.replace("$", "1" + "0" * 400), "must be a whole score; clean.single"),
    "a draw of text": (
        '{"schema": "np_drake.challenge_compare/1", "draws": [{"seeds": ["a"]}]}',
        "draws[0].seeds[0] must be a whole number from 0; got 'a'.",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_file_that_is_no_score_is_one_line(case, tmp_path, capsys):
    text, message = BAD[case]
    file = tmp_path / "score.json"
    file.write_text(text)
    assert run(["challenge", "compare", str(file)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"np-drake challenge compare: {file}: ")
    assert message in line


def test_the_pages_table_is_that_of_the_figures_that_are_kept(tmp_path, capsys):
    page = tmp_path / "draws.md"
    assert run(["challenge", "compare", str(STUDIES / "draws.json"), "--markdown", str(page)]) == 0
    lines = [line[2:-2].split(" | ") for line in page.read_text().splitlines() if line.startswith("| ")]
    clean, real = lines[1 : 1 + len(METRICS)], lines[2 + len(METRICS) :]
    assert len(clean) == len(real) == len(METRICS)
    rows = [[*a[:3], *b[1:3]] for a, b in zip(clean, real, strict=True)]
    written = (STUDIES / "diagnosis-benchmark.md").read_text().splitlines()
    assert {f"| {' | '.join(row)} |" for row in rows} <= set(written)
