"""The predictor on the paper's arrays: body axes, 400 Hz, one 10 s training segment."""

import numpy as np
import pytest

from np_drake.lifting.default_training import DefaultConfig
from np_drake.lifting.segments import Segment
from np_drake.lifting.skill import skill_table
from np_drake.lifting.training import train
from np_drake.residual_models.neural_predictor import NeuralPredictor, PredictorOptions

TRAINING, RACE_TRACK = "2021-02-03-13-44-49_seg_3", "2021-02-18-17-19-08_seg_2"
HORIZONS = [1, 5, 10, 20, 40, 100, 200, 400]


def arrays(folder, name: str) -> tuple[np.ndarray, np.ndarray]:
    """chi = [f, tau] and zeta = [v, omega], both body."""
    data = np.load(folder / "npy" / f"merged_{name}.npy").astype(float)
    return data[:, 6:12].copy(), data[:, 0:6].copy()


@pytest.fixture(scope="module")
def rows(neurobem):
    chi, zeta = arrays(neurobem, TRAINING)
    config = DefaultConfig(delay=25, symmetric=False, torque=True, starts=1)
    model = train([Segment(chi, zeta, 1 / 400)], config).model
    dut = NeuralPredictor(model, PredictorOptions(torque="predict"))
    mean = chi.mean(axis=0)
    chi, zeta = arrays(neurobem, RACE_TRACK)
    return skill_table({"np": dut}, chi[:6000], zeta[:6000], horizons=HORIZONS, mean=mean)


def test_one_step_ahead_it_is_better_than_the_paper(rows):
    one = next(row for row in rows if row.model == "np" and row.horizon == 1)
    assert one.force_rmse < 0.057  # [N] Jin et al. 2025, race track 1
    assert one.torque_rmse < 0.006  # [N·m]


def test_over_the_horizon_it_is_better_than_holding(rows):
    ratio = {row.horizon: row.force_ratio for row in rows if row.model == "np"}
    for horizon, bound in {1: 0.15, 5: 0.2, 10: 0.36, 20: 0.7, 40: 1.1}.items():
        assert ratio[horizon] < bound


def test_beyond_what_was_trained_it_does_not_diverge(rows):
    far = [row for row in rows if row.model == "np" and row.horizon >= 100]
    assert max(row.force_ratio for row in far) < 1.6
    assert max(row.torque_ratio for row in far) < 1.6
