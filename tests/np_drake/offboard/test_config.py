"""Laws of the limits and times of offboard control: what is impossible is refused by its name."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.offboard.config import OffboardConfig


def test_the_defaults_are_possible():
    dut = OffboardConfig()
    assert dut.check() is dut


@pytest.mark.parametrize("value", [0, -1, np.nan, np.inf])
@pytest.mark.parametrize(
    "name", [field.name for field in dc.fields(OffboardConfig) if field.name != "system"]
)
def test_a_value_that_is_not_positive_and_finite_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=f"offboard: {name} must be positive"):
        dc.replace(OffboardConfig(), **{name: value}).check()


@pytest.mark.parametrize("rate", [1.0, 1e4])
def test_a_rate_that_no_autopilot_takes_is_refused(rate):
    with pytest.raises(ValueError, match="offboard: rate must be"):
        OffboardConfig(rate=rate, stale_after=5.0).check()


@pytest.mark.parametrize("rate", [20.0, 100.0, 400.0])
def test_a_state_may_be_as_old_as_two_periods_and_no_less(rate):
    OffboardConfig(rate=rate, stale_after=2 / rate).check()
    with pytest.raises(ValueError, match="stale_after must be two periods"):
        OffboardConfig(rate=rate, stale_after=1.9 / rate).check()


@pytest.mark.parametrize("system", [-1, 256])
def test_a_system_that_mavlink_does_not_know_is_refused(system):
    with pytest.raises(ValueError, match="offboard: system must be 0 to 255"):
        OffboardConfig(system=system).check()
