"""Laws of the table over fleets and controllers."""

import numpy as np
import pytest

from diagrams.cooperative.table import cooperative_table

ERRORS = ("position_rmse", "E_xy", "E_z", "excursion", "first_rmse", "payload_rmse", "payload_excursion")


def made(row, seed, error):
    phase = dict.fromkeys(ERRORS, error)
    metrics = {
        "hover": phase,
        "transport": phase,
        "solve_failures": 1,
        "processor_time": 0.5,
        "closest": 0.8 + error,
    }
    metrics |= {"solve_ms": {"median": 2.0, "p95": 4.0}, "tension": {"min": 1.0 - error, "max": 2.0 + error}}
    return {"vehicles": 2, "row": row, "seed": seed, "metrics": metrics}


def test_a_line_is_the_mean_of_its_flights_with_students_interval():
    (line,) = cooperative_table([made("np", seed, error) for seed, error in enumerate((0.01, 0.02, 0.03))])
    assert line["flights"] == 3
    assert line["transport"]["E_xy"] == pytest.approx(0.02)
    assert line["transport"]["E_xy_ci95"] == pytest.approx(4.303 * 0.01 / np.sqrt(3), rel=1e-3)  # 2 degrees
    assert line["solve_failures"] == 3
    assert (line["closest"], line["tension"]["min"]) == pytest.approx((0.81, 0.97))  # nearest, slackest


def test_a_lost_flight_takes_the_figures_of_its_row_and_no_other():
    lost = {"vehicles": 2, "row": "hold", "seed": 1, "lost": "too close"}
    hold, np_line = cooperative_table([made("hold", 0, 0.01), lost, made("np", 0, 0.02)])
    assert hold["lost"] == ["too close"]
    assert "hover" not in hold
    assert np_line["hover"]["position_rmse"] == pytest.approx(0.02)
    assert np.isnan(np_line["hover"]["position_rmse_ci95"])  # one flight has no interval
