"""Laws of the estimation table's columns."""

import numpy as np
import pytest

from np_drake.estimation.wrench_table import CHANNELS, COLUMNS, PUBLISHED, column_rmse
from np_drake.logs.formats.neurobem import TESTS


def test_lengths_are_those_of_the_error_vector():
    row = column_rmse(np.tile([3.0, -4.0, 12.0, 0.3, 0.4, -1.2], (7, 1)))
    expected = [3.0, 4.0, 12.0, 0.3, 0.4, 1.2, 5.0, 0.5, 13.0, 1.3]
    assert list(row) == list(COLUMNS)
    np.testing.assert_allclose(list(row.values()), expected)


def test_rows_with_gaps_do_not_count():
    error = np.ones((4, 6))
    error[2, 5] = np.nan
    error[2, :5] = 100.0
    assert column_rmse(error)["F_x"] == 1.0
    with pytest.raises(ValueError, match="must have a row"):
        column_rmse(np.full((3, 6), np.nan))


def test_every_flight_is_published_with_every_column():
    assert set(PUBLISHED) == set(TESTS.values())
    assert {len(row) for rows in PUBLISHED.values() for row in rows.values()} == {len(COLUMNS)}


@pytest.mark.parametrize("method", ["NeuroMHE", "NP"])
@pytest.mark.parametrize("flight", PUBLISHED)
PRINTED_WRONG = ("melon 2", "NeuroBEM")  # its tau_xy and tau are no lengths of its components


def test_published_lengths_are_those_of_the_published_components():
    """Components have three digits, so that a length of three of them is known to about two in the last."""
    for flight, rows in PUBLISHED.items():
        for row in (row for method, row in rows.items() if (flight, method) != PRINTED_WRONG):
            squares = np.square(row[:6])
            for name, value in zip(COLUMNS, row, strict=True):
                assert value == pytest.approx(np.sqrt(squares[CHANNELS[name]].sum()), abs=0.0021), (flight, name)
