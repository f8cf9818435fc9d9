"""Laws of onsets near the end of a flight."""

import numpy as np

from np_drake.diagnosis.decision.causes import without_late_onsets
from np_drake.diagnosis.result import Cause

ENDS = {"a": 20.0, "b": 20.0}


def settled(**onset):
    return without_late_onsets([Cause("mass_error", 0.97, {}, onset)], ENDS)


def test_an_onset_in_the_last_second_of_a_flight_is_none():
    (cause,), late = settled(a=8.0, b=19.2)
    assert cause.onset == {"a": 8.0, "b": np.inf}
    assert late == []
    (cause,), _ = settled(a=None, b=18.9)
    assert cause.onset == {"a": None, "b": 18.9}


def test_what_begins_nowhere_else_is_no_cause():
    causes, (late,) = settled(a=19.5, b=np.inf)
    assert causes == []
    assert late.name == "mass_error"
