"""Laws of which flights stand out, and of what a quantity moves with."""

import numpy as np
import pytest

from np_drake.estimation.map_fit import Agreement
from np_drake.identification.flight_agreement import outlying


@pytest.mark.parametrize(
    "values, apart",
    [
        ([0.0, 0.1, -0.1, 0.05], []),
        ([0.0, 0.1, 3.0, -0.1, 0.05], [2]),
        ([0.0, np.nan, 0.1, 3.0, -0.1], [3]),  # NaN: tells nothing
    ],
)
def test_the_one_flight_that_differs_stands_out(values, apart):
    assert outlying(Agreement(np.array(values), np.full(len(values), 0.1), 0.0, 0.5)) == apart
