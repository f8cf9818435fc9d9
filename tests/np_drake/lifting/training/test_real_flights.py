"""The predictor on the paper's arrays: body axes, 400 Hz; what it must show on flights that it has
not seen.
"""

import numpy as np
import pytest

from np_drake.lifting.training.train import make_config, train
from np_drake.logs.formats.neurobem_wrenches import RACE_TRACK, TESTS, TRAINING, read_wrenches
from np_drake.residual_models.neural_predictor import NeuralPredictor, PredictorOptions
from np_drake.skill.skill import skill_table
from np_drake.training_data.segments import Segment

HORIZONS = [1, 5, 10, 20, 40, 100, 200, 400]
FORCE = [0.15, 0.20, 0.36, 0.58, 0.72, 0.85, 0.84]  # mean ratio to persistence, horizons up to 200
OTHER = "merged_2021-02-23-14-41-07_seg_3"


@pytest.fixture(scope="module")
def flights(neurobem):
    """name: (chi, zeta), both body."""
    sequences = {
        name: read_wrenches(neurobem / "npy" / f"{name}.npy")
        for name in (TRAINING, OTHER, *TESTS)
        if (neurobem / "npy" / f"{name}.npy").is_file()
    }
    return {name: (sequence.chi, sequence.zeta) for name, sequence in sequences.items()}


def trained(flights, names):
    """The predictor, and the mean of its training."""
    model = train(
        [Segment(*flights[name], 1 / 400) for name in names],
        make_config("mode-dictionary", frame="body"),
    ).model
    assert model.system.spectral_radius <= 1.0
    dut = NeuralPredictor(model, PredictorOptions(torque="predict"))
    return dut, np.concatenate([flights[name][0] for name in names]).mean(axis=0)


def scores(dut, mean, flight, known):
    """(8 horizons, 5) force_ratio, torque_ratio, torque_skill, force_rmse, torque_rmse."""
    wanted = ("force_ratio", "torque_ratio", "torque_skill", "force_rmse", "torque_rmse")
    rows = skill_table(
        {"np": dut},
        *flight,
        horizons=HORIZONS,
        mean=mean,
        zeta_known=known,
        warm_up=dut.model.window,
    )
    return np.array([[getattr(row, key) for key in wanted] for row in rows if row.model == "np"])


@pytest.fixture(scope="module")
def without(flights):
    """For every flight, a predictor that was trained without it: two are left out at a time."""
    names, out = list(flights), {}
    for pair in zip(names[::2], names[1::2], strict=True):
        out |= dict.fromkeys(pair, trained(flights, [name for name in names if name not in pair]))
    return out


@pytest.fixture(scope="module")
def circling(flights):
    """The predictor that was trained on the paper's ten seconds."""
    return trained(flights, [TRAINING])


@pytest.fixture(scope="module", params=[False, True], ids=["held", "known"])
def left_out(flights, without, request):
    """(8 flights, 8 horizons, 5)"""
    return np.stack([scores(*without[name], flights[name], request.param) for name in flights])


@pytest.fixture(scope="module", params=[False, True], ids=["held", "known"])
def from_one_segment(flights, circling, request):
    """The six test flights."""
    return {
        name: scores(*circling, flights[name], request.param) for name in TESTS if name in flights
    }


def test_force_of_a_flight_left_out_is_predicted_over_the_horizon(left_out):
    assert np.all(left_out[:, :7, 0].mean(axis=0) <= FORCE)


def test_torque_of_a_flight_left_out_is_no_worse_than_the_best_naive_row(left_out):
    assert np.all(left_out[..., 2].mean(axis=0) <= 1.0)
    assert left_out[..., 2].max() <= 1.02


def test_ten_seconds_of_circling_are_nowhere_worse_than_persistence(from_one_segment):
    for name, rows in from_one_segment.items():
        assert rows[:, :2].max() <= 1.0, name


def test_one_step_ahead_it_is_better_than_the_paper(from_one_segment):
    force, torque = from_one_segment[RACE_TRACK][0, 3:]
    assert force < 0.057 / 10  # [N] Jin et al. 2025, race track 1
    assert torque < 0.006 / 5  # [N·m]
