"""Laws of the headline, the sentence below it, and the tables, for every kind of answer."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.report.words import gap_rows, headline, lead, remains
from np_drake.diagnosis.result import UNKNOWN, ResidualFinding

TRACE = ResidualFinding(
    "periodic force", "a force at 2.3 Hz along body x, 0.4 N.", 0.6, {}, "hover at two thrusts"
)


SLOW = ResidualFinding(
    "slow", "something slow below 0.5 Hz", 0.04, {"share": 0.04, "force": 0.9}, "hover for a minute"
)


def with_left(diagnosis, **changes):
    """The same diagnosis with another remainder."""
    left = dc.replace(diagnosis.gap_reduction.remainder, **changes)
    return dc.replace(diagnosis, gap_reduction=dc.replace(diagnosis.gap_reduction, remainder=left))


def reduced(diagnosis, fraction=0.998, before=None, after=None):
    """The same diagnosis with another share of the gap, and with this replay."""
    found = with_left(diagnosis, share=1 - fraction)
    replays = {"replay_before": before, "replay_after": after}
    return dc.replace(found, gap_reduction=dc.replace(found.gap_reduction, **replays))


def sure(diagnosis, probability):
    """The same diagnosis with another probability of the unknown."""
    found = with_left(diagnosis, probability=probability)
    return dc.replace(found, unknown_probability=probability)


def clean(diagnosis):
    return dc.replace(reduced(diagnosis, fraction=0.97), verdict=(), causes=())


def no_gap(diagnosis):
    return with_left(reduced(diagnosis), share=np.nan)


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
    no_gap: (
        "There is no material gap on the held-out flights",
        "Training names suspended payload and linear drag, which these flights do not need.",
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
    assert headline(reduced(diagnosis, before=before, after=after)).endswith(said)


def with_channels(diagnosis, *channels):
    return dc.replace(diagnosis, localisation=dc.replace(diagnosis.localisation, channels=channels))


def test_a_remainder_that_the_rule_of_the_share_or_noise_hides_says_so(diagnosis):
    sizes = {"force": 1e-3, "torque": 0.0}
    small = with_left(diagnosis, share=0.005, position=0.43, noise=0.73, **sizes)
    said = remains(small).replace("\u00a0", " ")
    assert (
        "left beyond the noise (immaterial below 2 %): 1.0 mN and 0.43 m after 1 s, beside" in said
    )
    hidden = with_left(diagnosis, position=float("nan"), noise=1.7, **sizes)
    said = remains(hidden).replace("\u00a0", " ")
    assert ": 1.0 mN, beside up to 1.7 m after 1 s by noise alone." in said


def test_of_an_immaterial_gap_no_share_is_said(diagnosis):
    said = remains(with_left(diagnosis, share=float("nan"), position_before=0.011))
    assert (
        said.replace("\u00a0", " ")
        == "The held-out gap is immaterial: 1.1 cm after 1 s, beyond the noise."
    )


def test_a_torque_that_the_log_does_not_tell_is_no_part_of_the_gap(diagnosis):
    channels = diagnosis.localisation.channels
    silent = (dc.replace(c, rms=0.0, after=1e-14) if c.unit == "N·m" else c for c in channels)
    names = [row[0] for row in gap_rows(with_channels(diagnosis, *silent))]
    assert names == ["lateral force [N]", "vertical force [N]", "all, over noise [1]"]
