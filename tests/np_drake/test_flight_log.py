"""Laws of the path of a neighbour."""

import numpy as np
import pytest

from np_drake.flight_log import Neighbour


def test_a_path_is_linear_between_its_rows_and_unknown_beyond():
    dut = Neighbour(np.array([0.0, 2.0]), np.array([[0.0, 1.0, 2.0], [4.0, 1.0, 0.0]]))
    np.testing.assert_allclose(dut.at(0.5), [1.0, 1.0, 1.5], atol=1e-12)
    assert dut.at(np.zeros((3, 2))).shape == (3, 2, 3)
    assert np.isnan(dut.at([-0.1, 2.1])).all()


@pytest.mark.parametrize(
    "t, p, says",
    [
        ([0.0], [[0.0, 0.0, 0.0]], "two rows at least"),
        ([0.0, 1.0], [[0.0, 0.0], [0.0, 0.0]], "positions"),
        ([0.0, 0.0], np.zeros((2, 3)), "increasing"),
        ([0.0, 1.0], [[0.0, 0.0, np.nan], [0.0, 0.0, 0.0]], "finite"),
    ],
)
def test_what_is_no_path_is_refused_in_one_line(t, p, says):
    with pytest.raises(ValueError, match=f"^other: must have .*{says}"):
        Neighbour(np.array(t), np.array(p), "other")
