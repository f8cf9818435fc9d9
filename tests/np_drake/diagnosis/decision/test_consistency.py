"""Laws of causes that are withdrawn for what stands beside them, or does not."""

import dataclasses as dc

import pytest

from np_drake.diagnosis.decision.consistency import without_faint_shifts, without_missing_drag
from np_drake.diagnosis.result import Cause
from np_drake.effects.library import LIBRARY

LEAST = 0.03  # share of the largest shift [1]


def cause(name: str, share: float) -> Cause:
    return Cause(name, 1.0, {}, {}, (), share, LIBRARY[name].neutral())


def test_a_trace_of_one_shift_of_time_beside_another_is_minor():
    delay, drag = cause("command_delay", 0.7), cause("linear_drag", 1e-3)
    lag = cause("motor_lag", 0.5 * LEAST * 0.7)
    causes, minor = without_faint_shifts([lag, delay, drag], [], least=LEAST)
    assert causes == [delay, drag]
    assert [m.name for m in minor] == ["motor_lag"]
    equal = dc.replace(lag, share=2 * LEAST * 0.7)
    assert without_faint_shifts([equal, delay], [], least=LEAST) == ([equal, delay], [])
    assert without_faint_shifts([drag], [], least=LEAST) == ([drag], [])


@pytest.mark.parametrize(
    "beside, felt",
    [((), False), (("mass_error",), False), (("linear_drag",), True), (("quadratic_drag",), True)],
    ids=["alone", "beside a mass", "beside a drag", "beside another"],
)
def test_a_wind_is_a_cause_where_a_drag_is_one_that_feels_it(beside, felt):
    others = [cause(name, 0.5) for name in beside]
    causes, minor = without_missing_drag([cause("constant_wind", 0.5), *others], [])
    assert ("constant_wind" in {c.identifier for c in causes}) is felt
    assert [m.name for m in minor] == ["constant_wind"] * (not felt)
    assert all(c in causes for c in others)
