"""The published real flights: trained on two agile ones, judged on a third."""

from diagrams.gap.real_flights import GROUPS, agile_flights, fold, rows
from np_drake.logs.formats.neurobem import published_vehicle


def test_drag_is_found_and_the_gap_of_an_unseen_flight_closes(neurobem):
    # Short stretches, so that the test takes seconds; the figures of the docs are of whole flights.
    flights = [log.rows(len(log) // 3, len(log) // 3 + 4000) for log in agile_flights(neurobem)]
    one = fold(published_vehicle(), flights[:2], flights[3])
    assert {"linear_drag", "unknown"} <= set(one["verdict"])
    table = {line["group"]: line for line in rows([one]) if line["flight"] == one["flight"]}
    assert set(table) == set(GROUPS)
    assert table["lateral force"]["cut"] > 0.5  # 0.7 and more on whole flights
    assert table["vertical force"]["cut"] > 0.0
    assert table["torque"]["after"] < 0.25 * table["torque"]["nominal"]


def test_pooled_flights_weigh_by_their_rows():
    def one(name, square, count):
        groups = {
            group: {"nominal": [4.0 * square, count], "after": [square, count]} for group in GROUPS
        }
        return {"flight": name, "verdict": [], "squares": groups}

    line = rows([one("a", 9.0, 1), one("b", 1e-30, 8)])[-1]
    assert (line["after"], line["nominal"], line["cut"]) == (1.0, 2.0, 0.5)
