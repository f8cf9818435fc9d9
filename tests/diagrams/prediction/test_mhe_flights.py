"""The moving-horizon estimator on the real flights of the estimation table."""

import shutil

import numpy as np
import pytest

from diagrams.batch.run import Run
from diagrams.prediction import mhe_flights as dut
from np_drake.estimation.mhe_config import MheConfig
from np_drake.estimation.wrench_table import COLUMNS
from np_drake.logs.errors import LogError
from np_drake.logs.formats.neurobem_wrenches import RACE_TRACK


@pytest.fixture(scope="module")
def table(neurobem):
    return dut.mhe_table(Run(), neurobem, MheConfig(), names=["race track 1"])


def rows(table):
    return {row["row"]: row for row in table.rows}


def test_with_the_logged_attitude_fixed_weights_beat_the_published_row(table):
    ours, published = rows(table)[dut.ATTITUDE_ROW], rows(table)[dut.PUBLISHED_ROW]
    assert ours["held"] == 0
    for column in ("F", "tau"):
        assert ours[column] < 0.8 * published[column]


def test_the_torque_needs_no_attitude_and_the_force_does(table):
    alone, logged = rows(table)[dut.RATES_ROW], rows(table)[dut.ATTITUDE_ROW]
    for column in COLUMNS:
        if column.startswith("tau"):
            assert alone[column] == pytest.approx(logged[column], rel=1e-9)
    assert alone["F"] > 2 * logged["F"]


def test_persistence_of_the_label_beats_what_knows_the_motion_only(table):
    assert rows(table)[dut.NAIVE_ROW]["F"] < rows(table)[dut.ATTITUDE_ROW]["F"]


def test_program_and_closed_form_tell_the_same(table):
    assert table.disagreement < 1e-6  # [N, N·m]
    assert table.step_time > table.exact_step_time > 0


@pytest.mark.parametrize("rows", [slice(1, None), slice(None, None, -1)])
def test_an_attitude_of_other_rows_is_refused(neurobem, tmp_path, rows):
    for kind in ("npy", "csv"):
        (tmp_path / kind).mkdir()
    array = f"npy/{RACE_TRACK}.npy"
    np.save(tmp_path / array, np.load(neurobem / array)[rows])
    shutil.copy(neurobem / "csv" / f"{RACE_TRACK}.csv", tmp_path / "csv")
    with pytest.raises(LogError, match="must hold the same rows"):
        dut.mhe_table(Run(), tmp_path, MheConfig(), names=["race track 1"])
