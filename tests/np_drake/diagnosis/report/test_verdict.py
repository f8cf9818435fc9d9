"""Laws of the verdict in two sentences, for every kind of verdict."""

import dataclasses as dc

import pytest

from np_drake.diagnosis.report.verdict import headline, verdict_sentences
from np_drake.diagnosis.result import Finding

TRACE = Finding("periodic force", "a force at 2.3 Hz along body x, 0.4 N.", 0.6)


def clean(diagnosis):
    shrink = dc.replace(diagnosis.shrink, before=1.06, after=1.06, fraction=float("nan"))
    return dc.replace(diagnosis, verdict=(), causes=(), shrink=shrink)


def one(diagnosis):
    return dc.replace(diagnosis, verdict=("linear_drag",), causes=diagnosis.causes[1:])


def unknown(diagnosis):
    return dc.replace(clean(diagnosis), verdict=("unknown",), remains=(TRACE,), unknown_probability=0.97)


def part(diagnosis):
    changed = dc.replace(diagnosis, verdict=("suspended_payload", "unknown"), causes=diagnosis.causes[:1])
    return dc.replace(changed, remains=(TRACE,), unknown_probability=0.97)


def cannot_tell(diagnosis):
    return dc.replace(clean(diagnosis), cannot_tell=True)


CASES = {  # how the diagnosis is changed: what the headline, the first and the second sentence say
    clean: ("Nothing material", "agrees with the logs", "1.1 times the noise"),
    one: ("Missing: linear drag", "d_x 0.24 N·s/m, d_y 0.24 N·s/m", "Adding it closes 99.8 %"),
    unknown: ("something unknown", "no effect of the library explains (probability 97 %)", "2.3 Hz"),
    part: (
        "suspended payload and something unknown",
        "payload (probability 98 %), and something else",
        "remains",
    ),
    cannot_tell: ("cannot tell", "excite too little", "roll and pitch sharply"),
}


@pytest.mark.parametrize("change", CASES, ids=lambda change: change.__name__)
def test_the_verdict_is_two_sentences(diagnosis, change):
    dut = change(diagnosis)
    said = [headline(dut), *verdict_sentences(dut)]
    assert len(said) == 3
    for sentence, expected in zip(said, CASES[change], strict=True):
        assert expected in sentence.replace("\u00a0", " ")
    assert all(sentence.endswith(".") for sentence in said[1:])


def test_several_causes_are_named_with_what_they_cannot_be_told_from(diagnosis):
    first, second = verdict_sentences(diagnosis)
    assert "a suspended payload (probability 98\u00a0%) and linear drag" in first
    assert "cannot tell it from quadratic drag" in first
    assert second.startswith("Adding them closes")


def test_minor_findings_are_announced_on_a_clean_log(diagnosis):
    assert "1 minor finding below" in verdict_sentences(clean(diagnosis))[1]


def test_where_much_is_left_and_nothing_told_the_simulator_is_not_said_to_agree(diagnosis):
    dut = clean(diagnosis)
    dut = dc.replace(dut, shrink=dc.replace(dut.shrink, before=7.4, after=7.4))
    said = [headline(dut), *verdict_sentences(dut)]
    assert not any("agree" in sentence or "Nothing" in sentence for sentence in said)
    assert said[1].endswith("told in what is left, which is 7.4 times the noise of the training flights.")
    assert said[2].startswith("The flights that judge are noisier, or differ in what")
    assert "1 minor finding below" in said[2]


def test_without_a_manoeuvre_more_motion_is_asked_for(diagnosis):
    check = dc.replace(diagnosis.check, not_identifiable=())
    assert "more motion" in verdict_sentences(dc.replace(cannot_tell(diagnosis), check=check))[1]


def test_without_a_gap_on_held_out_flights_no_share_is_claimed(diagnosis):
    shrink = dc.replace(diagnosis.shrink, before=1.01, after=0.74, fraction=37.1)
    second = verdict_sentences(dc.replace(diagnosis, shrink=shrink))[1]
    assert "no gap above the noise" in second
    assert "%" not in second


def test_causes_that_make_it_worse_are_said_to(diagnosis):
    shrink = dc.replace(diagnosis.shrink, before=5.0, after=900.0, fraction=-3e4)
    assert "does not help" in verdict_sentences(dc.replace(diagnosis, shrink=shrink))[1]


def test_where_a_half_joined_the_fit_the_verdict_says_that_the_other_half_judges(diagnosis):
    joined = dc.replace(diagnosis, joined=diagnosis.held_out)
    assert "of the gap on held-out flights" in verdict_sentences(diagnosis)[1]
    assert "of the gap on the second half of held-out flights" in verdict_sentences(joined)[1]
