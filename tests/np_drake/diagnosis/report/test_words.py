"""Laws of numbers, units and names as text."""

import dataclasses as dc
import json

import numpy as np
import pytest

from np_drake.diagnosis import result as an
from np_drake.diagnosis.report import words as dut
from np_drake.diagnosis.result import Estimate


@pytest.mark.parametrize(
    "value, unit, ci95, text",
    [
        (0.004109, "kg", (0.003547, 0.004672), ("4.1 g", "3.5 to 4.7")),
        (0.26041, "kg", (0.2551, 0.2658), ("260 g", "255 to 266")),
        (21.37, "kg", (19.2, 23.5), ("21 kg", "19 to 24")),
        (1.2062, "m", (1.1990, 1.2133), ("1.206 m", "1.199 to 1.213")),
        (1.15e-5, "m", (-0.00205, 0.00207), ("0.0 cm", "−0.2 to 0.2")),
        (-0.0271, "rad", (-0.05, -0.004), ("−1.6°", "−2.9 to −0.2")),
        (3.0, "1", (float("nan"), float("nan")), ("3.0", "–")),
        (3.0, "furlong", (3.0 - 1e-9, 3.0 + 1e-9), ("3.00 furlong", "3.00 to 3.00")),
    ],
)
def test_an_estimate_has_the_digits_that_its_interval_tells(value, unit, ci95, text):
    found = dut.estimate(Estimate(value, unit, ci95), unit)
    assert tuple(part.replace(dut.NBSP, " ") for part in found) == text


GAP = an.ReplayGap(
    (0.5, 1.0), *(np.array([[0.1, 0.05, 0.2], [np.inf, 0.3, np.inf]]) for _ in range(3)), 24
)


def test_numbers_are_finite_or_null(diagnosis):
    reduction = dc.replace(diagnosis.gap_reduction, replay_before=GAP)
    causes = (dc.replace(diagnosis.causes[0], share=np.nan),)
    dut = dc.replace(diagnosis, gap_reduction=reduction, causes=causes).as_json()
    text = json.dumps(dut, allow_nan=False)
    assert json.loads(text) == dut
    assert dut["gap"]["replay"]["position"] == [0.1, None]
    assert dut["causes"][0]["share"] is None


def test_loads_are_told_flight_by_flight(diagnosis):
    mass, heavier, none = (an.Estimate(m, "kg", (m, m)) for m in (0.2, 0.45, 0.0))
    changes = {"a": (7.0, 13.0), "b": (np.inf, 9.0), "c": (np.inf, np.inf), "d": ()}
    parameters = {"mass": mass, "length": an.Estimate(0.8, "m", (0.8, 0.8))}
    onset = {"a": None, "b": 2.0, "c": None, "d": np.inf}
    how = {"loads": (heavier, none), "changes": changes}
    cause = an.Cause("suspended_payload", 0.9, parameters, onset, **how)
    plain = [line.replace(dut.NBSP, " ") for line in (*dut.begins(cause), dut.phrase(cause))]
    assert plain == [
        "a: 200 g, +250 g at 7.0 s, dropped at 13.0 s",
        "b: 200 g at 2.0 s, dropped at 9.0 s",
        "d: not at all",
        "a 200 g payload on 0.80 m (+250 g then dropped)",
    ]
    (steps,) = [c["steps"] for c in dc.replace(diagnosis, causes=(cause,)).as_json()["causes"]]
    assert steps["b"] == [{"time": 9.0, "mass": 0.0, "ci95": [0.0, 0.0]}]
    assert "steps" not in diagnosis.as_json()["causes"][0]


def test_a_warning_that_stands_before_the_answer_is_not_said_again(diagnosis):
    names = diagnosis.train + diagnosis.held_out
    doubt = f"{', '.join(names)}: thrust is a guess"
    lines = (*(f"{name}: thrust is a guess." for name in names), "no wind.")
    found = dc.replace(diagnosis, warnings=lines, doubts=(doubt,))
    assert dut.warnings(found)[-1] == "no wind."
    assert not any("a guess" in line for line in dut.warnings(found))
