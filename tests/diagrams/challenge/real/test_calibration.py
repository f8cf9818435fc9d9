"""Laws of calibration and tables: honest probabilities lie on the diagonal, and tables keep within their width."""

import numpy as np
import pytest

from diagrams.challenge.real.score import BIC, THIS, TOLD, verdict
from diagrams.challenge.real.study import bins, calibration_figure
from diagrams.challenge.real.summary import asked_figures
from diagrams.challenge.real.tables import tables
from diagrams.challenge.real.truth import TRUTHS
from diagrams.cli.output import WIDTH, print_table


def estimate(value: float, half: float) -> dict:
    return {"value": value, "ci95": [value - half, value + half], "unit": ""}


def record(mass: float = 0.0047, length: float = 0.497, p: float = 0.95, wrong: float = 0.2) -> dict:
    own = {"suspended_payload": {"mass": estimate(mass, 0.0002), "length": estimate(length, 0.01)}}
    truth, cut = TRUTHS["payload"], {"lateral": 0.9, "vertical": 0.8, "torque": None}
    causes = {"suspended_payload": p, "constant_wind": wrong}
    this = {**verdict(causes, truth), "parameters": own, "position": {"open": 0.09, "observed": 0.04}}
    this |= {"cut": cut, "seconds": 12.0, "new_condition": ""}
    bic = {**verdict({"suspended_payload": 1.0, "ground_effect": 1.0}, truth), "parameters": {}}
    told = {"causes": {}, "parameters": own}
    return {"group": "payload", "case": "06-10 -> 17-21", "methods": {THIS: this, BIC: bic, TOLD: told}}


def lines(records: list[dict]) -> dict[str, dict]:
    return {line["what"]: line for line in asked_figures(records)}


def test_honest_probabilities_lie_on_the_diagonal():
    draw = np.random.default_rng(0)
    p = draw.uniform(0, 1, 20_000)
    pairs = list(zip(p.tolist(), (draw.uniform(0, 1, p.size) < p).tolist(), strict=True))
    rows = bins(pairs)
    assert sum(row["n"] for row in rows) == p.size
    for row in rows:
        assert row["lower"] <= row["mean"] < row["upper"]
        assert row["rate"] == pytest.approx(row["mean"], abs=0.04)  # four deviations of the smallest bin


def test_a_certain_name_falls_in_the_last_bin_and_none_gives_no_bins():
    assert [row["n"] for row in bins([(1.0, True), (0.0, False)])] == [1, 1]
    assert bins([]) == []


def test_the_figure_names_axes_and_series():
    figure = calibration_figure({"real flights": [(0.9, True), (0.4, False)], "nothing": []})
    top, below = figure.axes
    assert "share that is true" in top.get_ylabel()
    assert "probability" in below.get_xlabel()
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["as reported", "real flights (n = 2)"]


def test_what_is_asked_counts_what_is_within_and_what_is_not():
    dut = lines([record(), record(mass=0.0040, p=0.5), record(length=0.55, wrong=0.95)])
    assert dut["payload: named, p ≥ 0.9"][THIS] == "2 of 3"
    assert dut["payload: mass within 10 %"][THIS] == "2 of 3"
    assert dut["payload: length within 4 %"][THIS] == "2 of 3"
    assert dut["payload: both in the 95 % interval"][THIS] == "1 of 3"
    assert dut["known cause: right"][THIS] == "1 of 3"
    assert dut["all: names that are wrong, p > 0.9"] == {
        "what": "all: names that are wrong, p > 0.9",
        "wanted": "0",
        THIS: "1",
        BIC: "3",
    }


def test_tables_keep_within_their_width(capsys):
    for table in tables([record(), record()]):
        print_table(*table)
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) > 20
    assert max(map(len, printed)) <= WIDTH
