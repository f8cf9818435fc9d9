"""Laws of `diagnosis.json` as docs/reference/files.md describes it."""

import json

import numpy as np

from np_drake.diagnosis import result as an

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
    where = an.Localisation(
        (
            an.ChannelGap("force x", "N", 0.4, 0.1, 0.11),
            an.ChannelGap("torque z", "N·m", 0.1, 0.1, 0.1),
        ),
        times={"heldout": np.arange(5.0)},
    )
    check = an.Identifiability(
        True, {"speed [m/s]": 1.0}, {"force x": 0.1}, (an.Confusable(("a", "b"), "alike", "roll"),)
    )
    gap_reduction = an.GapReduction(5.0, 1.1, replay_before=GAP)
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
    assert dut["gap"].keys() == {"force", "torque", "kinds", "regimes", "replay"}
    assert {"rms", "noise_floor"} <= dut["gap"]["force"]["x"].keys()
    assert dut["gap"]["replay"].keys() == {"horizon", "position", "velocity", "attitude_deg"}
    assert {"before", "after", "fraction", "ci95"} <= dut["shrink"]["residual"].keys()
    assert {"horizon", "before", "after"} <= dut["shrink"]["replay"].keys()
    assert dut["not_identifiable"] == [
        {"effects": ["a", "b"], "because": "alike", "manoeuvre": "roll"}
    ]
    assert dut["warnings"] == []


def test_numbers_are_finite_or_null():
    dut = small().as_json()
    text = json.dumps(dut, allow_nan=False)
    assert json.loads(text) == dut
    assert dut["gap"]["replay"]["position"] == [0.1, None]
    assert dut["causes"][0]["share"] is None
