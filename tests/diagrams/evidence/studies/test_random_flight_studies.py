"""Laws of the studies of drawn flights: what is compared, and how soon a change is known."""

import math

import numpy as np
import pandas as pd
import pytest

from diagrams.evidence.studies import random_flight_studies as drawn
from diagrams.evidence.studies.random_flight_studies import (
    CHANGES,
    compared,
    flown,
    known_after,
    responses,
)
from diagrams.evidence.studies.sweep import Row
from diagrams.loop.controller_config import FILTER_MODEL

T = 0.02 * np.arange(-100, 151)  # since the event [s]
FORCES = {"a step": ((T >= 0.3).astype(float), 0.3), "a ramp": (np.clip(T, 0.0, 1.0), 0.9)}


@pytest.mark.parametrize("what", FORCES)
@pytest.mark.parametrize(("level", "size"), [(0.0, 1.0), (-2.5, -1.0)])
def test_a_force_is_known_at_nine_tenths_of_its_change(what, level, size):
    force, expected = FORCES[what]
    assert known_after(T, level + size * force) == pytest.approx(expected, abs=0.0201)  # a sample


def lines(**columns):
    """Three draws flown by each row; inf: lost."""
    table = [
        {"row": row, "draw": draw, "kind": kind, "E_xy": e, "E_z": e, "gone": math.isinf(e)}
        for row, errors in columns.items()
        for draw, (kind, e) in enumerate(zip(("gusts", "rope", "rope"), errors, strict=True))
    ]
    found = compared(pd.DataFrame(table))
    return {(line.pop("kind"), line.pop("row")): line for line in found}


def test_rows_are_compared_in_the_same_draw_and_a_lost_flight_is_the_worst():
    found = lines(
        np=[math.inf, 0.02, 0.04], payload_filter=[0.05, 0.04, 0.02], hold=[0.1, 0.08, 0.08]
    )
    assert set(found) == {
        (k, row) for k in ("all", "rope", "gusts") for row in ("np", "payload_filter", "hold")
    }
    dut = found["all", "np"]
    assert (dut["flights"], dut["lost"], dut["E_xy"]) == (3, 1, 0.04)
    ratios = [dut["payload_filter_ratio"], dut["payload_filter_better"], dut["hold_ratio"]]
    assert [*ratios, dut["hold_better"]] == pytest.approx([2.0, 1 / 3, 0.5, 2 / 3])
    assert found["rope", "np"]["payload_filter_ratio"] == pytest.approx(1.25)
    assert found["gusts", "np"]["E_xy"] == math.inf
    assert "payload_filter_ratio" not in found["all", "payload_filter"]


def test_a_lost_flight_never_knows_its_change():
    nan = math.nan  # of a lost flight nothing is written
    table = {"known": [0.1, 0.2, 0.3, 0.1, 0.3, nan], "peak": [0.01, 0.03, 0.02, 0.01, 0.02, nan]}
    rows = {"row": 3 * ["np"] + 3 * ["hold"], "gone": 5 * [False] + [True]}
    np_line, hold = responses(pd.DataFrame(rows | table))
    keys = ("row", "flights", "lost", "known", "known_95", "peak_most")
    assert [np_line[k] for k in keys] == ["np", 3, 0, 0.2, 0.3, 0.03]
    assert [hold[k] for k in keys] == ["hold", 3, 1, 0.3, math.inf, math.inf]
    assert [np_line["soon"], hold["soon"]] == pytest.approx([2 / 3, 1 / 3])


def test_a_draw_that_cannot_be_flown_says_why(monkeypatch):
    def refuse(*_, **__):
        raise ValueError("too heavy")

    monkeypatch.setattr(drawn, "drawn_flight", refuse)
    case = {"draw": 0, "seed": 1}
    found = flown(case, Row("hold", "hold"), "", envelope=CHANGES, solver="sqp")
    assert found == {"kind": "", "lost": "too heavy"}


@pytest.mark.nightly
def test_a_drawn_change_is_flown_and_its_response_seen():
    case = {"draw": 0, "seed": 1}
    found = flown(case, drawn.ROWS[1], str(FILTER_MODEL), envelope=CHANGES, solver="sqp")
    assert (found["kind"], found["lost"]) == ("pendulum", "")
    assert 0.0 < found["known"] < 0.5  # [s]
    assert 0.0 < found["E_xy"] < found["peak"] < 0.5  # [m]
