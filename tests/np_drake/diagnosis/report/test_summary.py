"""Laws of the headline, the sentence below it, and the tables, for every kind of answer."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.report.answer import (
    MOST_DIFFERENCES,
    cause_table,
    difference_rows,
    gap_rows,
    headline,
    lead,
    main_remainder,
    unseen,
    warnings,
)
from np_drake.diagnosis.result import UNKNOWN, Confusable, Finding

TRACE = Finding(
    "periodic force", "a force at 2.3 Hz along body x, 0.4 N.", 0.6, {}, "hover at two thrusts"
)
SLOW = Finding(
    "slow", "something slow below 0.5 Hz", 0.04, {"share": 0.04, "force": 0.9}, "hover for a minute"
)


def reduced(diagnosis, **changes):
    """The same diagnosis with another share of the gap, and without a replay."""
    changes = {"replay_before": None, "replay_after": None} | changes
    left = dc.replace(diagnosis.gap_reduction.left, share=1 - changes.get("fraction", 0.998))
    return dc.replace(
        diagnosis, gap_reduction=dc.replace(diagnosis.gap_reduction, **{"left": left} | changes)
    )


def sure(diagnosis, probability):
    """The same diagnosis with another probability of the unknown."""
    left = dc.replace(diagnosis.gap_reduction.left, probability=probability)
    changed = dc.replace(diagnosis, gap_reduction=dc.replace(diagnosis.gap_reduction, left=left))
    return dc.replace(changed, unknown_probability=probability)


def clean(diagnosis):
    return dc.replace(reduced(diagnosis, fraction=0.97), verdict=(), causes=())


def no_gap(diagnosis):
    return reduced(
        diagnosis, fraction=0.0, left=dc.replace(diagnosis.gap_reduction.left, share=np.nan)
    )


def agrees(diagnosis):
    return dc.replace(no_gap(diagnosis), verdict=(), causes=())


def one(diagnosis):
    return dc.replace(diagnosis, verdict=("linear_drag",), causes=diagnosis.causes[1:])


def unknown(diagnosis):
    found = sure(reduced(clean(diagnosis), fraction=0.0), 0.97)
    return dc.replace(found, verdict=(UNKNOWN,), unexplained=(TRACE,))


def part(diagnosis):
    changed = dc.replace(
        diagnosis, verdict=("suspended_payload", UNKNOWN), causes=diagnosis.causes[:1]
    )
    return dc.replace(sure(reduced(changed, fraction=0.41), 0.97), unexplained=(TRACE, SLOW))


def cannot_tell(diagnosis):
    return dc.replace(clean(diagnosis), cannot_tell=True)


REMAINS = "to find what remains: hover for a minute."
PAYLOAD = (
    "A 260 g payload on 0.81 m and calibration explain 41 % of the gap on the held-out flights"
)
CASES = {  # how the diagnosis is changed: headline, and the sentence below it
    clean: (
        "Nothing material is missing: with calibration, the remainder on the held-out "
        "flights is 44 mN, 2.4 mN·m and "
        "1.3 cm after 1 s",
        "The simulator agrees with the logs, and nothing is named.",
    ),
    agrees: (
        "There is no material gap on the held-out flights",
        "The simulator agrees with the logs, and nothing is named.",
    ),
    no_gap: (
        "There is no material gap on the held-out flights",
        "Training names suspended payload and linear drag, which these flights do not need.",
    ),
    one: (
        "Linear drag of up to 0.24 N·s/m and calibration explain 99.8 % of the gap on the "
        "held-out flights; "
        "the replay improves from 0.85 m to 6.0 cm after 1 s",
        "Probability 93 %.",
    ),
    unknown: (
        (
            "No effect explains what is left on the held-out flights (97 %): 44 mN, 2.4 mN·m "
            "and 1.3 cm after 1 s"
        ),
        "To find what remains: hover at two thrusts.",
    ),
    part: (
        f"{PAYLOAD}; 59 % remains unexplained: 44 mN, 2.4 mN·m and 1.3 cm after 1 s "
        f"(probability that it is material "
        "97 %)",
        f"Probability 98 %; {REMAINS}",
    ),
    cannot_tell: (
        "These logs cannot tell",
        "The training flights excite too little to tell one effect from another.",
    ),
}


@pytest.mark.parametrize("change", CASES, ids=lambda change: change.__name__)
def test_the_answer_is_a_headline_and_a_sentence(diagnosis, change):
    dut = change(diagnosis)
    assert (
        tuple(text.replace("\u00a0", " ") for text in (headline(dut), lead(dut))) == CASES[change]
    )


def test_the_headline_names_three_causes_and_counts_the_rest(diagnosis):
    more = [
        dc.replace(diagnosis.causes[1], identifier=name, share=0.01)
        for name in ("blade_flapping", "thrust_drift")
    ]
    causes = (*diagnosis.causes, *more)
    dut = headline(
        dc.replace(diagnosis, causes=causes, verdict=tuple(c.identifier for c in causes))
    )
    assert dut.startswith(
        "A 260\u00a0g payload on 0.81\u00a0m, linear drag of up to 0.24\u00a0N·s/m, "
    )
    assert ", 1 more and calibration explain 99.8\u00a0% of the gap" in dut


def test_the_share_of_the_headline_is_that_of_all_channels(diagnosis):
    dut = reduced(gaps(diagnosis, after=1.0), fraction=0.31)
    assert " explain 31\u00a0% of the gap" in headline(dut)
    assert gap_rows(dut)[-1][-1].startswith("69\u00a0%")


@pytest.mark.parametrize(
    "factor, said",
    [
        (0.1, "the replay improves from 0.85\u00a0m to 8.5\u00a0cm after 1\u00a0s"),
        (1.0, "the replay does not improve (0.85\u00a0m to 0.85\u00a0m after 1\u00a0s)"),
        (2.0, "the replay gets worse (0.85\u00a0m to 1.7\u00a0m after 1\u00a0s)"),
        (np.inf, "the corrected simulator loses the vehicle after 1\u00a0s"),
    ],
)
def test_the_headline_says_whether_the_replay_improved(diagnosis, factor, said):
    before = diagnosis.gap_reduction.replay_before
    after = dc.replace(before, position=factor * before.position)
    assert headline(reduced(diagnosis, replay_before=before, replay_after=after)).endswith(said)


def test_calibration_is_named_where_the_vehicle_was_not_measured(diagnosis):
    described = dc.replace(one(diagnosis), calibration=())
    assert headline(described).startswith(
        "Linear drag of up to 0.24\u00a0N·s/m explains 99.8\u00a0%"
    )


def test_the_headline_says_which_cause_held_out_flights_contradict(diagnosis):
    assert "predicted better" not in headline(diagnosis)
    payload, drag = diagnosis.causes
    dut = dc.replace(
        diagnosis,
        causes=(dc.replace(payload, held_out_gain=0.9), dc.replace(drag, held_out_gain=-0.1)),
    )
    assert "on the held-out flights, which are predicted better without linear drag;" in headline(
        dut
    )


def test_the_headline_says_which_kind_of_force_the_causes_make_worse(diagnosis):
    assert "worse" not in headline(diagnosis)
    lift = [
        dc.replace(c, after=2 * c.rms if c.channel == "force z" else c.after)
        for c in diagnosis.localisation.channels
    ]
    dut = dc.replace(
        diagnosis, localisation=dc.replace(diagnosis.localisation, channels=tuple(lift))
    )
    assert " and make vertical force worse" in headline(dut)


def test_differences_have_a_size_an_interval_and_that_of_healthy_vehicles(diagnosis):
    rows = [
        tuple(cell.replace("\u00a0", " ") for cell in row) for row in difference_rows(diagnosis)
    ]
    assert rows == [
        ("Rotor 2: thrust +4.0 %", "± 2.0 %", "± 3.0 %"),
        ("Attitude reads +0.92° of pitch", "± 0.57°", "± 1.1°"),
        ("Torque that drifts by 1.2 mN·m RMS", "–", "± 2.0 mN·m"),
    ]


def test_few_differences_are_shown_and_none_that_is_small(diagnosis):
    large, _, _ = diagnosis.calibration
    assert (
        len(difference_rows(dc.replace(diagnosis, calibration=20 * (large,)))) == MOST_DIFFERENCES
    )
    assert (
        difference_rows(dc.replace(diagnosis, calibration=(dc.replace(large, value=-0.01),))) == []
    )


def test_a_second_answer_that_differs_is_pointed_to(diagnosis):
    second = one(diagnosis)
    assert "second answer" in lead(dc.replace(diagnosis, refit=second))
    assert "second answer" not in lead(dc.replace(diagnosis, refit=diagnosis))


def gaps(diagnosis, after):
    """The same diagnosis with this residual over noise in every channel."""
    channels = tuple(
        dc.replace(c, after=after * c.noise_floor) for c in diagnosis.localisation.channels
    )
    return dc.replace(diagnosis, localisation=dc.replace(diagnosis.localisation, channels=channels))


def test_unknown_takes_nothing_from_the_probability_of_a_cause(diagnosis):
    header, rows = cause_table(part(diagnosis))
    shown = {row[0]: row[4].replace("\u00a0", " ") for row in rows if row[0]}
    assert header[:5] == ["cause", "parameter", "value", "95 % interval", "probability"]
    assert shown == {"suspended_payload": "98 %"}


def test_the_cause_with_the_largest_share_comes_first(diagnosis):
    turned = dc.replace(diagnosis, causes=diagnosis.causes[::-1])
    assert headline(turned) == headline(diagnosis)
    assert headline(turned).startswith("A 260\u00a0g payload")
    assert cause_table(turned) == cause_table(diagnosis)


def test_the_table_says_what_a_cause_cannot_be_told_from_if_any(diagnosis):
    header, rows = cause_table(diagnosis)
    assert header[6:] == ["begins", "or else"]
    assert next(row for row in rows if row[0] == "linear_drag")[-1] == "quadratic_drag"
    assert "heldout_2: 8.0\u00a0s" in rows[0][6]
    alone = dc.replace(diagnosis, causes=(dc.replace(diagnosis.causes[0], onset={}),))
    assert "or else" not in cause_table(alone)[0]
    assert "begins" not in cause_table(alone)[0]


def test_without_a_gap_on_held_out_flights_no_share_is_claimed(diagnosis):
    dut = no_gap(diagnosis)
    assert "%" not in headline(dut) + lead(dut)
    assert gap_rows(dut)[-1][-1] == "–"


def test_causes_that_make_it_worse_are_said_to(diagnosis):
    assert "do not help: the gap" in headline(reduced(diagnosis, fraction=-1.0))


def test_what_remains_is_the_largest_in_weight():
    assert main_remainder((TRACE, SLOW)) is SLOW
    assert main_remainder((TRACE,)) is TRACE


def test_where_a_half_joined_the_fit_the_other_half_judges(diagnosis):
    joined = dc.replace(diagnosis, joined=diagnosis.held_out)
    assert "gap on the held-out flights" in headline(diagnosis)
    assert "gap on the second half of the held-out flights" in headline(joined)


def test_what_is_new_on_held_out_flights_is_said_at_the_top(diagnosis):
    dut = dc.replace(
        clean(diagnosis), new_on_held_out=(Finding("wind", "a slow force along x, 3 N.", 3.0),)
    )
    assert lead(dut).endswith("; new on the held-out flights: a slow force along x, 3 N.")


def test_effects_without_a_trace_are_named(diagnosis):
    assert unseen(diagnosis) == ""  # its pairs are told together
    nothing = Confusable(("ground_effect",), "no trace", "descend")
    dut = dc.replace(
        diagnosis,
        identifiability=dc.replace(diagnosis.identifiability, not_identifiable=(nothing,)),
    )
    assert unseen(dut) == "At its usual size the training flights would not show: ground effect."


def test_a_warning_of_several_flights_is_one_line(diagnosis):
    said = (
        "train_1: no acceleration",
        "heldout_1: no acceleration",
        "train_1: no acceleration",
        "other: thing",
    )
    dut = dc.replace(
        diagnosis, warnings=said, identifiability=dc.replace(diagnosis.identifiability, warnings=())
    )
    assert warnings(dut) == ["train_1, heldout_1: no acceleration", "other: thing"]
