"""Laws of what to do next."""

import dataclasses as dc

from np_drake.diagnosis.report.answer import next_steps
from np_drake.diagnosis.result import Estimate, Finding


def test_a_named_cause_is_checked_told_apart_and_added(diagnosis):
    steps = next_steps(diagnosis)
    assert (
        steps[0] == "To check a suspended payload: weigh what hangs below, and measure its tether."
    )
    assert "To tell linear drag from quadratic drag, fly: sprints at 1, 3 and 6 m/s" in steps[1]
    assert steps[-1].startswith("Add them to the simulator")


def test_logs_that_excite_nothing_ask_for_a_manoeuvre(diagnosis):
    dut = dc.replace(diagnosis, cannot_tell=True, verdict=(), causes=())
    (step,) = next_steps(dut)
    assert "roll and pitch sharply" in step
    (plain,) = next_steps(
        dc.replace(dut, identifiability=dc.replace(dut.identifiability, not_identifiable=()))
    )
    assert plain == "Fly with more motion in every axis. Diagnose again."


def test_a_wide_interval_asks_for_a_flight_that_narrows_it(diagnosis):
    wide = dc.replace(
        diagnosis.causes[1],
        indistinguishable_from=(),
        parameters={
            "d_x": Estimate(0.2, "N·s/m", (0.0, 0.4)),
            "d_y": Estimate(0.1, "N·s/m", (0.09, 0.11)),
        },
    )
    dut = dc.replace(diagnosis, verdict=("linear_drag",), causes=(wide,))
    assert next_steps(dut)[0].startswith(
        "Intervals of linear_drag are wide (d_x); a better flight: sprints"
    )
    sure = dc.replace(wide, parameters={"d_x": Estimate(0.2, "N·s/m", (0.19, 0.21))})
    assert not any("wide" in step for step in next_steps(dc.replace(dut, causes=(sure,))))


def test_a_simulator_that_cannot_be_flown_is_not_recommended(diagnosis):
    dut = next_steps(
        dc.replace(diagnosis, not_flyable="nominal loses the vehicle; measure the thrust")
    )
    assert (
        dut[0]
        == "Do not fly the corrected simulator: nominal loses the vehicle; measure the thrust."
    )
    assert not any(step.startswith("Add ") for step in dut)


def test_what_was_not_tested_asks_for_another_held_out_flight(diagnosis):
    dut = dc.replace(
        diagnosis,
        verdict=("unknown",),
        unexplained=(Finding("line", "a line", 1.0, {"frequency": 2.3}),),
        coverage=(
            "The held-out flight reaches 0.3 m/s, training 2.1 m/s: linear drag was not tested.",
        ),
    )
    assert next_steps(dut) == ["Hold out a flight that moves like the training flights."]


def test_where_nothing_is_missing_there_is_nothing_to_do(diagnosis):
    assert next_steps(dc.replace(diagnosis, verdict=(), causes=(), coverage=())) == []
