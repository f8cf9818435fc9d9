"""Laws of the headline, the sentence below it, and the tables, for every kind of answer."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.report.summary import (
    cause_table,
    gap_parts,
    gap_rows,
    headline,
    lead,
    main_remainder,
    unseen,
    warnings,
)
from np_drake.diagnosis.result import ChannelGap, Confusable, Finding

TRACE = Finding("periodic force", "a force at 2.3 Hz along body x, 0.4 N.", 0.6)
SLOW = Finding("slow", "something slow below 0.5 Hz", 0.04, {"share": 0.04, "force": 0.9})


def clean(diagnosis):
    gap_reduction = dc.replace(diagnosis.gap_reduction, before=1.06, after=1.06, fraction=float("nan"))
    return dc.replace(diagnosis, verdict=(), causes=(), gap_reduction=gap_reduction)


def one(diagnosis):
    return dc.replace(diagnosis, verdict=("linear_drag",), causes=diagnosis.causes[1:])


def unknown(diagnosis):
    return dc.replace(clean(diagnosis), verdict=("unknown",), unexplained=(TRACE,), unknown_probability=0.97)


def part(diagnosis):
    changed = dc.replace(diagnosis, verdict=("suspended_payload", "unknown"), causes=diagnosis.causes[:1])
    return dc.replace(changed, unexplained=(TRACE, SLOW), unknown_probability=0.97)


def cannot_tell(diagnosis):
    return dc.replace(clean(diagnosis), cannot_tell=True)


def unexplained(diagnosis):
    dut = clean(diagnosis)
    return dc.replace(dut, gap_reduction=dc.replace(dut.gap_reduction, before=7.4, after=7.4))


CASES = {  # how the diagnosis is changed: headline, and the sentence below it
    clean: (
        "Nothing material is missing",
        "On the held-out flights the simulator agrees with the logs: the residual is 1.1 times the noise.",
    ),
    one: ("Linear drag of up to 0.24 N·s/m, 93 %", "Explains > 99.9 % of the lift gap on the held-out flights."),
    unknown: ("Something that no effect explains, 97 %", "Its clearest trace: a force at 2.3 Hz along body x, 0.4 N."),
    part: (
        "A 260 g payload on 0.81 m, 98 %",
        "Explains > 99.9 % of the lift gap on the held-out flights; "
        "what remains: something slow below 0.5 Hz, 4 % of weight.",
    ),
    cannot_tell: ("These logs cannot tell", "The training flights excite too little to tell one effect from another."),
    unexplained: (
        "No cause is told",
        "The residual is 7.4 times the noise on the held-out flights, and nothing in training shows its cause.",
    ),
}


@pytest.mark.parametrize("change", CASES, ids=lambda change: change.__name__)
def test_the_answer_is_a_headline_and_a_sentence(diagnosis, change):
    dut = gaps(change(diagnosis), after=1.0)
    assert tuple(text.replace("\u00a0", " ") for text in (headline(dut), lead(dut))) == CASES[change]


def gaps(diagnosis, after):
    """The same diagnosis with this residual over noise in every channel."""
    channels = tuple(dc.replace(c, after=after * c.noise_floor) for c in diagnosis.localisation.channels)
    return dc.replace(diagnosis, localisation=dc.replace(diagnosis.localisation, channels=channels))


def test_unknown_takes_nothing_from_the_probability_of_a_cause(diagnosis):
    header, rows = cause_table(part(diagnosis))
    shown = {row[0]: row[1].replace("\u00a0", " ") for row in rows if row[0]}
    assert header[:5] == ["cause", "probability", "parameter", "value", "95 % interval"]
    assert shown == {"suspended_payload": "98 %", "unknown": "97 %"}


def test_the_cause_with_the_largest_share_comes_first(diagnosis):
    turned = dc.replace(diagnosis, causes=diagnosis.causes[::-1])
    assert headline(turned) == headline(diagnosis)
    assert headline(turned).startswith("A 260\u00a0g payload")
    assert cause_table(turned) == cause_table(diagnosis)


def test_the_table_says_what_a_cause_cannot_be_told_from_if_any(diagnosis):
    header, rows = cause_table(diagnosis)
    assert header[5:] == ["begins", "or else"]
    assert next(row for row in rows if row[0] == "linear_drag")[-1] == "quadratic_drag"
    assert "heldout_2: 8.0\u00a0s" in rows[0][5]
    alone = dc.replace(diagnosis, causes=(dc.replace(diagnosis.causes[0], onset={}),))
    assert "or else" not in cause_table(alone)[0]
    assert "begins" not in cause_table(alone)[0]


def test_without_a_gap_on_held_out_flights_no_share_is_claimed(diagnosis):
    gap_reduction = dc.replace(diagnosis.gap_reduction, before=1.01, after=0.74, fraction=37.1)
    dut = dc.replace(diagnosis, gap_reduction=gap_reduction)
    assert "no gap above the noise" in lead(dut)
    assert "%" not in lead(dut)
    assert gap_rows(dut)[-1][-1] == "–"


def test_causes_that_make_it_worse_are_said_to(diagnosis):
    assert "do not help" in lead(gaps(diagnosis, after=60.0))
    gap_reduction = dc.replace(diagnosis.gap_reduction, before=5.0, after=900.0, fraction=-3e4)
    assert "do not help" in lead(dc.replace(diagnosis, gap_reduction=gap_reduction))


def test_the_share_is_that_of_the_largest_part_of_the_gap(diagnosis):
    lateral, lift, torque = gap_parts(diagnosis.localisation)
    assert [p.kind for p in (lateral, lift, torque)] == ["lateral force", "lift", "torque"]
    assert lateral.before == pytest.approx(np.hypot(0.05 * 8, 0.05 * 7))  # [N]
    assert lift.explained == pytest.approx(1 - (1.08**2 - 1) / (22**2 - 1))
    channels = tuple(dc.replace(c, rms=50 * c.rms) if c.unit == "N·m" else c for c in diagnosis.localisation.channels)
    assert "of the torque gap" in lead(
        dc.replace(diagnosis, localisation=dc.replace(diagnosis.localisation, channels=channels))
    )


def test_a_torque_that_the_log_does_not_tell_is_no_part_of_the_gap(diagnosis):
    silent = tuple(
        dc.replace(c, rms=0.0, after=1e-14) if c.unit == "N·m" else c for c in diagnosis.localisation.channels
    )
    dut = dc.replace(diagnosis, localisation=dc.replace(diagnosis.localisation, channels=silent))
    assert [row[0] for row in gap_rows(dut)] == ["lateral force [N]", "lift [N]", "all, over noise [1]"]


def test_small_vehicles_have_small_units(diagnosis):
    channels = (ChannelGap("force z", "N", 0.034, 0.0038, 0.0066, 0.97),)
    row, _ = gap_rows(dc.replace(diagnosis, localisation=dc.replace(diagnosis.localisation, channels=channels)))
    assert row[:4] == ("lift [mN]", "34", "6.6", "3.8")


def test_what_remains_is_the_largest_in_weight():
    assert main_remainder((TRACE, SLOW)) is SLOW
    assert main_remainder((TRACE,)) is TRACE


def test_where_a_half_joined_the_fit_the_other_half_judges(diagnosis):
    joined = dc.replace(diagnosis, joined=diagnosis.held_out)
    assert "gap on the held-out flights" in lead(diagnosis)
    assert "gap on the second half of the held-out flights" in lead(joined)


def test_what_is_new_on_held_out_flights_is_said_at_the_top(diagnosis):
    dut = dc.replace(clean(diagnosis), new_on_held_out=(Finding("wind", "a slow force along x, 3 N.", 3.0),))
    assert lead(dut).endswith("; new on the held-out flights: a slow force along x, 3 N.")


def test_effects_without_a_trace_are_named(diagnosis):
    assert unseen(diagnosis) == ""  # its pairs are told together
    nothing = Confusable(("ground_effect",), "no trace", "descend")
    dut = dc.replace(diagnosis, identifiability=dc.replace(diagnosis.identifiability, not_identifiable=(nothing,)))
    assert unseen(dut) == "At its usual size the training flights would not show: ground effect."


def test_a_warning_of_several_flights_is_one_line(diagnosis):
    said = ("train_1: no acceleration", "heldout_1: no acceleration", "train_1: no acceleration", "other: thing")
    dut = dc.replace(diagnosis, warnings=said, identifiability=dc.replace(diagnosis.identifiability, warnings=()))
    assert warnings(dut) == ["train_1, heldout_1: no acceleration", "other: thing"]
