"""Laws of the estimation table's columns."""

import numpy as np
import pytest

from np_drake.estimation.wrench_table import COLUMNS, PUBLISHED, column_rmse
from np_drake.logs.formats.neurobem_wrenches import TESTS


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
    assert len([rows for rows in PUBLISHED.values() if "NP" in rows]) == 6


PRINTED_SO = {  # lengths that are printed otherwise than their components make them
    ("melon 2", "NeuroBEM", "tau"),
    ("ellipse", "NeuroBEM", "tau"),
    ("figure-8 4", "NeuroMHE", "tau"),
}


@pytest.mark.parametrize(
    "flight, method", [(flight, method) for flight in PUBLISHED for method in PUBLISHED[flight]]
)
def test_published_lengths_follow_from_published_components(flight, method):
    """To the rounding of three decimals: no figure is mistyped."""
    row = dict(zip(COLUMNS, PUBLISHED[flight][method], strict=True))
    for kind in (kind for kind in ("F", "tau") if (flight, method, kind) not in PRINTED_SO):
        x, y, z = (row[f"{kind}_{axis}"] for axis in "xyz")
        assert row[f"{kind}_xy"] == pytest.approx(np.hypot(x, y), abs=0.0015)
        assert row[kind] == pytest.approx(np.sqrt(x * x + y * y + z * z), abs=0.0015)
