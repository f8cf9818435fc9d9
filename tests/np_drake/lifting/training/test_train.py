"""Laws of the default training, and of what it refuses to learn from."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.lifting.model.lifted_linear_system import advance
from np_drake.lifting.training.excitation import excitation
from np_drake.lifting.training.neural_window import NeuralWindowConfig
from np_drake.lifting.training.paper_training import PaperConfig
from np_drake.lifting.training.train import make_config, train
from np_drake.training_data.segments import Segment, group_scale, white_noise


def test_the_seed_decides_and_progress_ascends_to_its_total(dithered):
    calls: list[tuple[int, int, float]] = []
    config = PaperConfig(epochs=2, spacing=40)
    first = train([dithered.segment], config, on_epoch=lambda *call: calls.append(call)).model
    again, other = (
        train([dithered.segment], dc.replace(config, seed=seed)).model for seed in (0, 1)
    )
    np.testing.assert_array_equal(again.system.B, first.system.B)
    np.testing.assert_array_equal(again.encoder.weights[0], first.encoder.weights[0])
    assert not np.array_equal(other.system.B, first.system.B)
    assert [call[:2] for call in calls] == [(1, 2), (2, 2)]
    assert all(np.isfinite(loss) for _, _, loss in calls)


@pytest.mark.parametrize("config", [PaperConfig(epochs=1), NeuralWindowConfig(epochs=10)])
def test_a_flight_that_shows_nothing_teaches_to_hold(config):
    still = Segment(np.tile([0.0, 0.0, -2.5, 0.0, 0.0, 0.0], (300, 1)), np.zeros((300, 6)), 0.02)
    model = train([still], config).model
    s, z = model.system, model.encoder(np.hstack([still.chi, still.zeta])[: model.window])
    for steps in (0, 10, 40):
        later = s.C @ advance(z, s.A, s.B, np.ones((steps, 6)))
        assert later[2] == pytest.approx(-2.5, abs=0.1)  # [N]
    assert "0 of 6" in model.summary["excitation"]


def test_configurations_go_by_name_and_suit_their_axes():
    assert make_config("paper", epochs=3).epochs == 3
    assert not make_config("paper", frame="body").symmetric
    for arguments, match in (
        ({"configuration": "theirs"}, r"paper \| neural-window \| mode-dictionary; got theirs"),
        ({"configuration": "paper", "epocs": 3}, "has no setting epocs"),
        ({"configuration": "mode-dictionary"}, "these are in world axes"),
        ({"configuration": "neural-window", "frame": "body"}, "these are in body axes"),
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
    assert "of the motion is one line at 0.2" in text  # 1.5 rad/s is 0.24 Hz
    assert excitation([dithered.segment]).startswith("6 of 6 directions of zeta excited")


def test_excitation_has_no_units(plain):
    units = np.repeat([100.0, 180.0 / np.pi], 3)  # cm/s and degrees/s
    other = dc.replace(plain.segment, zeta=units * plain.zeta)
    assert excitation([other]) == excitation([plain.segment])
