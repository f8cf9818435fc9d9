"""Laws of the truth: what is known to be there or not is judged, the rest is neither right nor wrong."""

import pytest

from diagrams.challenge.real.cases import GROUPS
from diagrams.challenge.real.truth import DRAG, TRUTHS, named
from np_drake.effects.library import LIBRARY


def test_every_group_has_a_truth_with_source_and_names_of_the_library():
    assert set(TRUTHS) == set(GROUPS)
    for truth in TRUTHS.values():
        assert truth.source
        assert {*truth.present, DRAG, *truth.false} <= set(LIBRARY)
        assert not {*truth.present, DRAG} & set(truth.false)


def test_a_cause_counts_above_one_half_only():
    assert named({"linear_drag": 0.5, "mass_error": 0.51}) == ["mass_error"]


@pytest.mark.parametrize("group", ["payload", "payload-command", "wind"])
def test_without_its_known_cause_an_answer_is_not_right(group):
    truth = TRUTHS[group]
    assert not truth.right({})
    assert not truth.right({truth.present[0]: 0.2})
    assert truth.right({truth.present[0]: 0.6, "linear_drag": 0.9, "thrust_scale": 0.9})


@pytest.mark.parametrize("group", GROUPS)
def test_a_false_name_makes_an_answer_wrong_and_a_silent_one_does_not(group):
    truth = TRUTHS[group]
    known = {truth.present[0]: 0.9} if truth.present else {}
    assert truth.right(known)
    for name in truth.false:
        assert truth.wrong({**known, name: 0.6}) == [name]
        assert not truth.right({**known, name: 0.6})
        assert truth.right({**known, name: 0.4})


def test_what_is_not_known_is_not_judged():
    causes = {"suspended_payload": 0.8, "linear_drag": 0.7, "mixer_gain": 0.9, "constant_wind": 0.3}
    assert TRUTHS["bare"].judged(causes) == [(0.8, False), (0.7, True), (0.3, False)]
