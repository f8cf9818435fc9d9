"""Laws of the grid's table and maps, on made-up records."""

import numpy as np
import pytest

from diagrams.robustness.axes import Grid, distinct
from diagrams.robustness.grid_report import grid_figure
from diagrams.robustness.grid_table import NAIVE, grid_by_speed, grid_points, grid_table

GRID = Grid().thinned(2)  # payloads 0, 0.5 kg; tethers 0.4, 1.6 m; speeds 0.5, 2.5 m/s: 6 points
# E_xy by row where nothing else is said [m]; np has half the error of the best naive row and ten
# times the oracle's.
ERROR = {"nominal": 0.05, "hold": 0.04, "np": 0.02, "oracle": 0.002}


def made(change):
    """Return records of three seeds; `change(row, setting)` returns what differs in the result."""
    records = []
    for setting in distinct(GRID.settings()):
        for row, error in ERROR.items():
            for seed in (1, 2, 3):
                result = {
                    "E_xy": error * (1 + 0.001 * seed),
                    "E_z": 0.01,
                    "growth": 1.0,
                    "swing_growth": 1.0,
                }
                result |= {"lost_at": None, "solve_failures": 0, "at_limit": 0.0} | change(
                    row, setting
                )
                case = {"row": row, "model": "", **setting, "seed": seed}
                records.append({"case": case, "result": result, "seconds": 1.0})
    return records


def table(change):
    return {line["row"]: line for line in grid_table(grid_points(made(change), GRID))}


def test_naive_rows_are_those_that_learn_nothing():
    assert {"nominal", "hold", "hold + total mass"} <= set(NAIVE)
    assert not {"np", "gp", "oracle"} & set(NAIVE)


def test_shares_count_points_once_and_ratios_are_of_means():
    dut = table(
        lambda row, setting: {"E_xy": 0.004} if row == "np" and setting["mass"] == 0 else {}
    )
    assert dut["np"]["points"] == 6
    assert dut["np"]["near"] == pytest.approx(2 / 6)  # without payload: 0.4 cm of at most 0.5 cm
    assert dut["np"]["worst"] == pytest.approx(10.0)
    assert dut["np"]["worst_at"]["mass"] == 0.5
    assert dut["oracle"]["near"] == 1.0
    assert dut["np"]["better"] == {"nominal": 1.0, "hold": 1.0}
    assert dut["np"]["worse"] == {"nominal": 0.0, "hold": 0.0}
    assert dut["nominal"]["worse"] == {"hold": 1.0}


def test_a_speed_has_median_and_range_and_no_loss_is_averaged_away():
    def change(row, setting):
        if row == "np" and setting["speed"] == 2.5:
            return {"lost_at": 3.0, "E_xy": None} if setting["mass"] == 0 else {}
        return {"E_xy": 0.01 * setting["length"]} if row == "np" else {}

    dut = {line["row"]: line["speeds"] for line in grid_by_speed(grid_points(made(change), GRID))}
    assert dut["np"][2.5] is None
    assert dut["np"][0.5] == pytest.approx(
        (0.008, 0.004, 0.016)
    )  # of 0.8 m (no payload), 0.4 and 1.6 m


def test_the_bound_near_the_oracle_is_twice_its_error_and_a_millimetre():
    for error, share in ((0.005, 1.0), (0.00503, 0.0)):  # [m]; the oracle's mean is 0.002004 m
        dut = table(lambda row, setting, error=error: {"E_xy": error} if row == "np" else {})
        assert dut["np"]["near"] == share


def test_a_lost_flight_is_worse_and_not_near():
    def change(row, setting):
        if (row, setting["speed"]) == ("np", 2.5):
            return {"E_xy": None, "growth": None, "swing_growth": None, "lost_at": 7.0}
        return {"E_xy": 0.003} if row == "np" else {}

    dut = table(change)
    assert dut["np"]["near"] == dut["np"]["better"]["hold"] == dut["np"]["worse"]["hold"] == 0.5
    assert (dut["np"]["lost"], dut["np"]["flights"]) == (9, 18)
    assert dut["hold"]["lost"] == 0


@pytest.mark.parametrize("key", ["growth", "swing_growth"])
def test_error_and_swing_both_count_as_growing(key):
    dut = table(
        lambda row, setting: {key: 1.6} if row == "np" and setting["speed"] == 2.5 else {key: 1.4}
    )
    assert (dut["np"]["growing"], dut["hold"]["growing"]) == (3, 0)


def test_no_payload_has_no_swing_that_could_grow():
    dut = table(lambda row, setting: {"swing_growth": None} if setting["mass"] == 0 else {})
    assert dut["np"]["growing"] == 0


def test_without_an_oracle_nothing_is_near_it():
    records = [r for r in made(lambda *_: {}) if r["case"]["row"] != "oracle"]
    line = next(line for line in grid_table(grid_points(records, GRID)) if line["row"] == "np")
    assert (line["near"], line["worst"], line["worst_at"]) == (None, None, None)
    figure = grid_figure(grid_points(records, GRID), GRID, row="np")
    assert len([ax for ax in figure.axes if ax.images]) == len(GRID.speed)


def test_the_maps_have_a_panel_for_each_speed_and_ratio():
    def change(row, setting):
        lost = (row, setting["speed"], setting["length"]) == ("np", 2.5, 1.6)
        return {"E_xy": None, "lost_at": 7.0} if lost else {}

    figure = grid_figure(grid_points(made(change), GRID), GRID, row="np")
    panels = [ax for ax in figure.axes if ax.images]
    assert [ax.get_title() for ax in panels] == ["0.5 m/s", "2.5 m/s"] * 2
    written = [[text.get_text() for text in ax.texts] for ax in panels]
    # From the shortest tether up, payloads 0 and 0.5 kg: both tethers show the same flight without
    # payload.
    assert written[0] == ["10", "10", "10", "10"]
    assert written[3] == ["0.5", "0.5", "0.5", "× 3/3"]
    assert np.ma.getmaskarray(np.ma.masked_invalid(panels[3].images[0].get_array()))[1, 1]
    assert panels[0].images[0].get_array()[0, 0] == pytest.approx(np.log2(10.0 / 2.0))
    assert (panels[2].get_xlabel(), panels[0].get_ylabel()) == ("payload [kg]", "tether [m]")
