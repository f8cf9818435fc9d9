"""The predictor on the paper's arrays: body axes, 400 Hz; what it must show on flights that it has
not seen.
"""

import numpy as np
import pytest

from np_drake.lifting.training.train import make_config, train
from np_drake.logs.formats.neurobem_wrenches import RACE_TRACK, TESTS, TRAINING, read_wrenches
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.skill.skill import skill_table
from np_drake.training_data.segments import Segment

HORIZONS = [1, 5, 10, 20, 40, 100, 200, 400]
FORCE = [0.15, 0.20, 0.36, 0.58, 0.72, 0.85, 0.84]  # mean ratio to persistence, horizons up to 200
OTHER = "merged_2021-02-23-14-41-07_seg_3"
WANTED = ("force_ratio", "torque_ratio", "torque_skill", "force_rmse", "torque_rmse")


@pytest.fixture(scope="module")
def flights(neurobem):
    """name: (chi, zeta), both body."""
    files = {name: neurobem / "npy" / f"{name}.npy" for name in (TRAINING, OTHER, *TESTS)}
    sequences = {name: read_wrenches(path) for name, path in files.items() if path.is_file()}
    return {name: (sequence.chi, sequence.zeta) for name, sequence in sequences.items()}


def trained(flights, names):
    """The predictor, and the mean of its training."""
    segments = [Segment(*flights[name], 1 / 400) for name in names]
    model = train(segments, make_config("mode-dictionary", frame="body")).model
    assert model.system.spectral_radius <= 1.0
    mean = np.concatenate([flights[name][0] for name in names]).mean(axis=0)
    return NeuralPredictor(model, torque="predict"), mean


def scores(dut, mean, flight, known):
    """(8 horizons, 5) the `WANTED`."""
    options = {"horizons": HORIZONS, "mean": mean, "warm_up": dut.model.window}
    rows = skill_table({"np": dut}, *flight, zeta_known=known, **options)
    return np.array([[row[key] for key in WANTED] for row in rows if row["model"] == "np"])


@pytest.mark.nightly
@pytest.mark.parametrize("known", [False, True], ids=["held", "known"])
def test_of_flights_left_out_force_is_predicted_and_torque_no_worse_than_naive(flights, known):
    """Two are left out at a time."""
    names, found = list(flights), []
    for pair in zip(names[::2], names[1::2], strict=True):
        dut = trained(flights, [name for name in names if name not in pair])
        found += [scores(*dut, flights[name], known) for name in pair]
    left_out = np.stack(found)
    assert np.all(left_out[:, :7, 0].mean(axis=0) <= FORCE)
    assert np.all(left_out[..., 2].mean(axis=0) <= 1.0)
    assert left_out[..., 2].max() <= 1.02


@pytest.mark.parametrize(
    "name",
    [RACE_TRACK, *(pytest.param(n, marks=pytest.mark.nightly) for n in TESTS if n != RACE_TRACK)],
)
def test_ten_seconds_of_circling_are_nowhere_worse_than_persistence(flights, name):
    if name not in flights:
        pytest.skip(f"no {name} here")
    rows = scores(*trained(flights, [TRAINING]), flights[name], True)
    assert rows[:, :2].max() <= 1.0
    if name == RACE_TRACK:  # one step ahead, Jin et al. 2025, race track 1
        assert rows[0, 3] < 0.057 / 10  # [N]
        assert rows[0, 4] < 0.006 / 5  # [N·m]
