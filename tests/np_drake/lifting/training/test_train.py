"""Laws of the default training, and of what it refuses to learn from."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.estimation.noise import white_noise
from np_drake.lifting.training.excitation import excitation
from np_drake.lifting.training.neural_lpv import NeuralLpvConfig
from np_drake.lifting.training.paper_training import PaperConfig
from np_drake.lifting.training.train import make_config, train
from np_drake.residual_models.flight_forecasts import walk
from np_drake.residual_models.lifted_predictor import LiftedLinearPredictor
from np_drake.training_data.segments import Segment, group_scale, of_wrenches


@pytest.mark.parametrize("config", [PaperConfig(epochs=2, spacing=40), NeuralLpvConfig(epochs=10)])
def test_the_seed_decides_and_progress_ascends_to_its_total(config, dithered, tmp_path):
    calls: list[tuple[int, int, float]] = []
    for name, own in (("first", config), ("again", config), ("other", dc.replace(config, seed=1))):
        found = train([dithered.segment], own, on_epoch=lambda *call: calls.append(call))
        dc.replace(found.model, summary={}).save(tmp_path / name)
    first, again, other = ((tmp_path / name).read_bytes() for name in ("first", "again", "other"))
    assert first == again != other
    assert [done for done, _, _ in calls] == 3 * list(range(1, config.epochs + 1))
    assert all(total == config.epochs and np.isfinite(loss) for _, total, loss in calls)


@pytest.mark.parametrize(
    ("config", "zeta"), [(PaperConfig(epochs=1), 1.0), (NeuralLpvConfig(batch=8, epochs=300), 0.0)]
)
def test_a_flight_that_shows_nothing_teaches_to_hold(config, zeta):
    still = Segment(np.tile([0.0, 0.0, -2.5, 0.0, 0.0, 0.0], (300, 1)), np.zeros((300, 6)), 0.02)
    dut = LiftedLinearPredictor.of(train([still], config).model)
    *_, (_, memory) = walk(dut, of_wrenches(still.chi, still.zeta, 0.02))
    ahead = dut.forecast(memory, horizon=41, stride=1).rollout(np.full((41, 6), zeta))
    np.testing.assert_allclose(ahead[:, 2], -2.5, atol=0.1)  # [N]
    assert "0 of 6" in dut.model.summary["excitation"]


def test_configurations_go_by_name_and_suit_their_axes():
    assert make_config("paper", epochs=3).epochs == 3
    assert not make_config("paper", frame="body").symmetric
    for arguments, match in (
        ({"configuration": "theirs"}, r"paper \| neural-lpv \| mode-dictionary; got theirs"),
        ({"configuration": "paper", "epocs": 3}, "has no setting epocs"),
        ({"configuration": "mode-dictionary"}, "these are in world axes"),
        ({"configuration": "neural-lpv", "frame": "body"}, "these are in body axes"),
    ):
        with pytest.raises(ValueError, match=match):
            make_config(**arguments)


def test_white_noise_is_told_from_motion():
    t = np.arange(2000) * 0.02
    noise = 0.03 * np.random.default_rng(0).standard_normal((2000, 1))
    assert white_noise([np.sin(3.0 * t)[:, None] + noise]) == pytest.approx(0.03, rel=0.1)


def test_a_group_of_channels_has_one_scale():
    values = np.random.default_rng(0).standard_normal((500, 6)) * [3, 4, 0, 1, 1, 1] + 5.0
    scale = group_scale([values], centred=True)
    np.testing.assert_allclose(scale[:3], np.sqrt(25 / 3), rtol=0.1)
    assert group_scale([np.zeros((10, 6))], centred=True).tolist() == [1.0] * 6


def test_vertical_speed_is_noise_on_a_plain_circle_alone(plain, dithered):
    text = excitation([plain.segment])
    assert "of 6 directions of zeta excited, not vz (" in text
    assert excitation([dithered.segment]).startswith("6 of 6 directions of zeta excited")


def test_excitation_has_no_units(plain):
    units = np.repeat([100.0, 180.0 / np.pi], 3)  # cm/s and degrees/s
    other = dc.replace(plain.segment, zeta=units * plain.zeta)
    assert excitation([other]) == excitation([plain.segment])
