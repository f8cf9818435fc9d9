"""Laws of the margins; nothing flies here."""

import json

import pytest

from diagrams.batch.campaign import case_file
from diagrams.cli.main import run
from diagrams.robustness import margins
from diagrams.robustness.axes import BASE
from diagrams.robustness.margins import (
    MARGINS,
    SPEEDS,
    Searching,
    last_that_holds,
    margin_cases,
    margin_table,
    stable,
)
from diagrams.robustness.robustness import ROWS, flight_config

DELAY = MARGINS[0]


@pytest.mark.parametrize("bound", [0.0, 0.004, 0.005, 0.033, 0.06, 0.119, 0.12, 1.0])
def test_bisection_finds_the_last_value_below_the_bound(bound):
    asked = []

    def holds(value):
        asked.append(value)
        return value <= bound

    expected = max(value for value in DELAY.values if value <= bound)
    assert last_that_holds(holds, DELAY.values) == expected
    assert len(asked) == len(set(asked)) <= 7  # both ends, and log2 of 24 steps


def test_what_fails_at_once_has_no_margin():
    assert last_that_holds(lambda value: False, DELAY.values) is None


def test_margins_go_in_steps_of_5_ms_and_5_per_cent_and_can_be_flown():
    assert DELAY.values[:3] == (0.0, 0.005, 0.01)
    assert DELAY.values[-1] == 0.12  # [s]
    for margin in MARGINS:
        assert margin.values[0] == BASE[margin.axis]
        step = margin.values[1] - margin.values[0]
        assert [
            b - a for a, b in zip(margin.values, margin.values[1:], strict=False)
        ] == pytest.approx([step] * (len(margin.values) - 1))
        case = {"row": "oracle", "seed": 1, **BASE, margin.axis: margin.values[-1]}
        assert flight_config(case, solver="sqp")


def test_lost_and_growing_flights_do_not_hold():
    assert stable({"lost_at": None, "growth": 1.5})
    assert not stable({"lost_at": None, "growth": 1.51})
    assert not stable({"lost_at": 3.0, "growth": None})


def made(case):
    """Fly nothing: a vehicle that is lost above a delay of 32 ms, whose error grows below 0.7 of
    its gain.
    """
    lost = case["delay"] > 0.032 or case["gain"] > 1.72
    return {
        "lost_at": 2.0 if lost else None,
        "growth": None if lost else 1.0 + (case["gain"] < 0.7),
    }


@pytest.mark.parametrize(
    ("name", "margin"), [("delay", 0.03), ("gain up", 1.7), ("gain down", 0.7)]
)
def test_a_search_varies_its_own_quantity_alone(name, margin):
    case = next(
        c for c in margin_cases(ROWS[:1], [7], {}) if c["margin"] == name and c["speed"] == 2.5
    )
    flown = []

    def fly(case):
        flown.append(case)
        return made(case)

    dut = Searching(fly)(case)
    assert dut["margin"] == margin
    assert [flight["value"] for flight in dut["flights"]] == [
        f["gain" if "gain" in name else name] for f in flown
    ]
    axis = "gain" if "gain" in name else "delay"
    assert all(f["seed"] == 7 and f["speed"] == 2.5 for f in flown)
    assert all(f[key] == BASE[key] for f in flown for key in BASE.keys() - {axis, "speed"})


def test_every_margin_is_a_case_of_its_own():
    cases = margin_cases(ROWS, [1, 2], {})
    assert (
        len(cases)
        == len({case_file(case) for case in cases})
        == 2 * len(ROWS) * len(SPEEDS) * len(MARGINS)
    )


def records(value):
    """Return a record of every margin of two rows with seeds 1, 2; `value(case)` is the margin."""
    return [
        {"case": case, "result": {"margin": value(case), "flights": []}, "seconds": 1.0}
        for case in margin_cases(ROWS[:2], [1, 2], {})
    ]


def test_the_table_has_means_and_marks_the_end_of_the_search():
    lines = margin_table(
        records(lambda case: 0.02 * case["seed"] if case["margin"] == "delay" else 3.0)
    )
    assert [(line["row"], line["speed"]) for line in lines] == [
        (row.name, speed) for speed in SPEEDS for row in ROWS[:2]
    ]
    delay, up = (lines[0]["margins"][name] for name in ("delay", "gain up"))
    assert delay["values"] == [0.02, 0.04]
    assert delay["mean"] == pytest.approx(0.03)
    assert delay["ci95"] == pytest.approx(
        12.7062 * 0.01, rel=1e-4
    )  # t(0.975, 1) s / sqrt(2), s = 0.01 sqrt(2)
    assert (delay["end"], up["end"]) == (False, True)


def test_the_verb_prints_the_margins_of_every_seed(monkeypatch, tmp_path, capsys):
    def runs(sweep, rows):
        found = records(
            lambda case: (
                None
                if case["speed"] == 2.5
                else 0.12
                if case["margin"] == "delay"
                else 0.8 + 0.1 * case["seed"]
            )
        )
        found[-1] = {"case": found[-1]["case"], "error": "its process died", "seconds": None}
        return [], found

    monkeypatch.setattr(margins, "run_margins", runs)
    files = ["--json", str(tmp_path / "m.json"), "--markdown", str(tmp_path / "m.md")]
    assert run(["reproduce", "margins", "--seeds", "2", *files]) == 0
    page = (tmp_path / "m.md").read_text()
    assert "| nominal | 1.5 | ≥ 0.12 ± 0 (0.12, 0.12) | 0.95 ± 0.64 (0.9, 1) |" in page
    assert "| hold | 2.5 | (none, none) |" in page
    assert "its process died" in capsys.readouterr().out
    assert len(json.loads((tmp_path / "m.json").read_text())["table"]) == 4
