"""Laws of `diagnosis.json` as docs/reference/files.md describes it."""

import dataclasses as dc
import json

import numpy as np

from np_drake.diagnosis import result as an
from np_drake.diagnosis import result as residual_parts

GAP = an.ReplayGap(
    (0.5, 1.0), *(np.array([[0.1, 0.05, 0.2], [np.inf, 0.3, np.inf]]) for _ in range(3)), 24
)


def small() -> an.Diagnosis:
    cause = an.Cause(
        "mass_error",
        0.9,
        {"delta_mass": an.Estimate(0.1, "kg", (0.05, 0.15))},
        {"train_1": None, "heldout": 3.0},
    )
    where = residual_parts.Localisation(
        (
            residual_parts.ChannelGap("force x", "N", 0.4, 0.1, 0.11, 0.97),
            residual_parts.ChannelGap("torque z", "N·m", 0.1, 0.1, 0.1, np.nan),
        ),
        (residual_parts.Segment("heldout", 0.0, 3.0, (1.0,) * 6),),
        (residual_parts.Regime("speed", "m/s", 0.0, 1.0, 100, (1.0,) * 6),),
        (residual_parts.Band("force x", np.arange(3.0), np.ones(3), np.ones(3), np.ones(3)),),
        times={"heldout": np.arange(5.0)},
    )
    check = an.Identifiability(
        True, {"speed [m/s]": 1.0}, {"force x": 0.1}, (an.Confusable(("a", "b"), "alike", "roll"),)
    )
    gap_reduction = an.GapReduction(
        5.0, 1.1, 1.0, 0.99, (0.98, 1.0), (an.Rung("nominal", 5.0),), GAP, None
    )
    return an.Diagnosis(
        "mine", ("train_1",), ("heldout",), ("mass_error",), (cause,), check, where, gap_reduction
    )


def test_the_file_has_the_fields_of_the_schema():
    dut = small().as_json()
    assert dut["schema"] == "np_drake.diagnosis/1"
    assert dut["verdict"] == ["mass_error"]
    (cause,) = dut["causes"]
    assert cause["effect"] == "mass_error"
    assert cause["onset"] == {"train_1": None, "heldout": 3.0}
    assert cause["parameters"]["delta_mass"] == {"value": 0.1, "unit": "kg", "ci95": [0.05, 0.15]}
    assert {"probability", "indistinguishable_from"} <= cause.keys()
    assert dut["gap"].keys() == {
        "force",
        "torque",
        "kinds",
        "replay",
        "segments",
        "regimes",
        "bands",
    }
    assert {"rms", "noise_floor", "explained"} <= dut["gap"]["force"]["x"].keys()
    assert dut["gap"]["replay"].keys() == {"horizon", "position", "velocity", "attitude_deg"}
    assert {"before", "after", "fraction", "ci95"} <= dut["shrink"]["residual"].keys()
    assert {"horizon", "before", "after"} <= dut["shrink"]["replay"].keys()
    assert dut["shrink"]["ladder"] == [{"name": "nominal", "residual": 5.0}]
    assert dut["not_identifiable"] == [
        {"effects": ["a", "b"], "because": "alike", "manoeuvre": "roll"}
    ]
    assert dut["warnings"] == []
    assert dut["explanations"] == []
    assert dut["readings"] is None


def test_differences_have_their_flights_only_where_they_differ():
    same = an.Difference("mass_error.delta_mass", "mass +10 g", 0.01, "kg", 0.005, (0.0, 0.02))
    own = an.Difference(
        "gyro_bias.x",
        "gyroscope reads +1.0 °/s about x in a",
        0.017,
        "rad/s",
        0.02,
        by_flight={"a": 0.017},
    )
    first, second = dc.replace(small(), calibration=(same, own)).as_json()["calibration"]
    assert first.keys() == {"name", "text", "value", "unit", "deviation", "ci95"}
    assert second["by_flight"] == {"a": 0.017}
    assert second["ci95"] == [None, None]
    assert same.in_deviations == 2.0


def test_numbers_are_finite_or_null():
    dut = small().as_json()
    text = json.dumps(dut, allow_nan=False)
    assert json.loads(text) == dut
    assert dut["gap"]["replay"]["position"] == [0.1, None]
    assert dut["gap"]["torque"]["z"]["explained"] is None
    assert dut["causes"][0]["share"] is None


def test_without_a_replay_there_is_none():
    bare = dc.replace(small(), gap_reduction=dc.replace(small().gap_reduction, replay_before=None))
    assert bare.as_json()["gap"]["replay"] is None
    assert bare.as_json()["shrink"]["replay"] is None


def test_a_flight_without_the_effect_is_told_from_one_with_it_throughout():
    whole = small()
    cause = dc.replace(whole.causes[0], onset={"train_1": None, "heldout": np.inf})
    (dut,) = dc.replace(whole, causes=(cause,)).as_json()["causes"]
    assert dut["onset"] == {"train_1": None, "heldout": None}
    assert dut["absent_from"] == ["heldout"]
