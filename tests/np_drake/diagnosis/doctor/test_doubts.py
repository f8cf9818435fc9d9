"""What stands against any answer from a flight: laws that fail, and a large share of the weight."""

import dataclasses as dc

import pytest

from np_drake.diagnosis.doctor.examine import examine
from np_drake.diagnosis.doctor.flight_facts import law_doubts
from np_drake.vehicle import Vehicle


@pytest.fixture(scope="module")
def log(fly):
    return fly(seed=1, noise=1.0)


def test_conventions_that_contradict_each_other_fail(log):
    for wrong in (
        dc.replace(log, v=log.v * [1.0, -1.0, 1.0]),
        dc.replace(log, q=log.q * [1.0, -1.0, -1.0, -1.0]),
    ):
        (dut,) = (doubt for doubt in law_doubts(wrong) if "contradict" in doubt.what)
        assert dut.fails
    assert not examine([wrong], Vehicle()).usable


@pytest.mark.parametrize("factor, axis", [(1.45, "z"), (0.6, "z")])
def test_a_residual_above_a_quarter_of_the_weight_is_the_first_line(log, factor, axis):
    heavy = dc.replace(Vehicle(), mass=factor * Vehicle().mass)
    dut = examine([log], heavy)
    assert f"% of the weight along body {axis}: check mass" in dut.problems[0]
    assert "misses" in dut.problems[0]
