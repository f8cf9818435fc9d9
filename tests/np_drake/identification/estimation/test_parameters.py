import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.identification.estimation import Layout, Parameter

ALL = (
    Parameter("a", 1.0, 0.5),
    Parameter("b", 0.0, 0.3, log=True, needs=("motors",)),
    Parameter("c", 2.0, 0.1, needs=("voltage",)),
    Parameter("own", 0.1, 0.2, flight=True),
)


@pytest.fixture
def dut():
    return Layout.of(ALL, {"motors"}, 3)


@given(z=st.floats(-6.0, 6.0))
def test_a_logarithmic_parameter_stays_positive_and_a_plain_one_is_linear(z):
    assert ALL[1].value(z) == pytest.approx(np.exp(0.3 * z))
    assert ALL[0].value(z) == pytest.approx(1.0 + 0.5 * z)


def test_each_place_belongs_to_all_flights_or_to_one(dut):
    own = [set(dut.indices(k)) - set(range(len(dut.shared))) for k in range(3)]
    assert set.union(*own) == set(range(len(dut.shared), dut.size))
    assert sum(map(len, own)) == 3


def test_a_flight_sees_its_own_value_and_all_flights_their_mean(dut):
    z = np.array([0.0, 0.0, 1.0, 2.0, 6.0])
    assert [dut.values(z, k)["own"] for k in range(3)] == pytest.approx([0.3, 0.5, 1.3])
    assert dut.values(z)["own"] == pytest.approx(0.1 + 0.2 * 3.0)
