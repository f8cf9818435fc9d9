"""Laws of the default training, and of what it refuses to learn from."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.lifting.model.lifted_linear_system import advance
from np_drake.lifting.training import paper_training
from np_drake.lifting.training.excitation import measure_excitation
from np_drake.lifting.training.neural_window import NeuralWindowConfig
from np_drake.lifting.training.paper_training import PaperConfig
from np_drake.lifting.training.train import make_config, train
from np_drake.training_data.segments import Segment, group_scale, white_noise

VZ, FZ = 2, 2


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


def vertical_gain(model) -> float:
    """Largest response of f_z to v_z within the horizon [N per m/s]."""
    s = model.system
    response = [s.C @ np.linalg.matrix_power(s.A, i) @ s.B for i in range(40)]
    return float(np.abs(np.sum(response, axis=0)[FZ, VZ]))


def test_vertical_speed_is_noise_on_a_plain_circle_alone(plain, dithered):
    dut = measure_excitation([plain.zeta], step=0.02)
    assert dut.shrink[VZ, VZ] < 0.1
    assert "vz" in dut.text.split("shrunk along")[1]
    assert 0.8 < dut.line_share <= 1.0
    assert dut.line_frequency == pytest.approx(1.5 / (2 * np.pi), abs=0.02)
    shaken = measure_excitation([dithered.zeta], step=0.02)
    assert shaken.shrink[VZ, VZ] > 0.8
    assert np.all(shaken.gain > 0.5)


def test_b_is_shrunk_where_the_flight_said_nothing(plain, dithered, monkeypatch):
    """Unguarded, believed in every direction, the same flight teaches to answer v_z with force."""
    config = PaperConfig(epochs=1)
    assert vertical_gain(train([plain.segment], config).model) < 0.1
    assert vertical_gain(train([dithered.segment], config).model) > 0.1
    monkeypatch.setattr(
        paper_training,
        "measure_excitation",
        lambda *a, **k: dc.replace(measure_excitation(*a, **k), gain=np.ones(6)),
    )
    assert vertical_gain(train([plain.segment], config).model) > 0.5


def test_shrinking_has_no_units_and_keeps_what_was_excited(plain):
    units = np.repeat([100.0, 180.0 / np.pi], 3)  # cm/s and degrees/s
    si, other = (
        measure_excitation([scale * plain.zeta], step=0.02).shrink for scale in (1.0, units)
    )
    np.testing.assert_allclose(other, units[:, None] * si / units, atol=1e-9)
    motion = np.sin(np.arange(3000)[:, None] * 0.02 * np.linspace(1.0, 3.0, 6))
    np.testing.assert_allclose(measure_excitation([motion]).shrink, np.eye(6), atol=0.02)
