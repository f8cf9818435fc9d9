"""The published real flights: trained on two agile ones, judged on a third."""

import numpy as np
import pytest

from diagrams.gap.real_flights import GROUPS, agile_flights, fold, rows
from np_drake.logs.formats.neurobem import published_vehicle


@pytest.fixture(scope="module")
def one(neurobem):
    """Short stretches, so that the test takes seconds; the figures of the docs are those of whole
    flights.
    """
    flights = [log.rows(len(log) // 3, len(log) // 3 + 4000) for log in agile_flights(neurobem)]
    return fold(published_vehicle(), [flights[0], flights[1]], flights[3])


def test_drag_is_found_and_something_stays_unknown(neurobem, one):
    verdict = one.verdict
    assert {"linear_drag", "unknown"} <= set(verdict)


def test_the_gap_of_an_unseen_flight_closes_in_force_and_torque(neurobem, one):
    table = {r["group"]: r for r in rows([one]) if r["flight"] == one.name}
    assert set(table) == set(GROUPS)
    assert table["lateral force"]["cut"] > 0.5  # 0.7 and more on whole flights
    assert (
        table["vertical force"]["cut"] > 0.0
    )  # little on such stretches; whole flights, pooled: see the docs
    assert table["torque"]["after"] < 0.25 * table["torque"]["nominal"]
    assert np.isfinite([r["after"] for r in table.values()]).all()
