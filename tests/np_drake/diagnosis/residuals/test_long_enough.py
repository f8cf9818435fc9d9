"""Laws of flights that are too short for residuals."""

import dataclasses as dc

from np_drake.diagnosis.residuals import long_enough


def test_a_part_that_is_too_short_is_left_out_and_said(fly):
    whole = fly(name="a", seed=1, seconds=5.0)
    part = dc.replace(whole.rows(0, 100), name="b")
    kept, said = long_enough([whole, part])
    assert kept == [whole]
    assert len(said) == 1
    assert said[0].startswith("b:")


def test_where_all_are_too_short_none_is_left_out(fly):
    part = fly(name="a", seed=1, seconds=5.0).rows(0, 100)
    assert long_enough([part]) == ([part], ())
