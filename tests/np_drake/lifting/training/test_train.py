"""Laws of the default training, and of what it refuses to learn from."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.lifting.model.adaptive_family import AdaptiveFamily
from np_drake.lifting.model.lifted_linear_system import advance
from np_drake.lifting.training import family_training
from np_drake.lifting.training.excitation import measure_excitation
from np_drake.lifting.training.family_training import LiftedConfig
from np_drake.lifting.training.paper_training import PaperConfig
from np_drake.lifting.training.train import make_config, train
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.skill.skill import skill_table
from np_drake.training_data.segments import Segment, group_scale, white_noise

HORIZONS = [0, 5, 10, 20, 40]
VZ, FZ = 2, 2


def force_rows(model, flight) -> dict[int, dict]:
    rows = skill_table(
        {"np": NeuralPredictor(model)},
        flight.chi,
        flight.zeta,
        target=flight.truth,
        horizons=HORIZONS,
        mean=np.zeros(6),
    )
    return {row["horizon"]: row for row in rows if row["model"] == "np"}


def test_on_an_unseen_path_it_predicts_far_better_than_holding(trained, lemniscate):
    rows = force_rows(trained.model, lemniscate)
    for horizon, ratio in {0: 0.7, 5: 0.6, 10: 0.5, 20: 0.35, 40: 0.25}.items():
        assert rows[horizon]["force_ratio"] < ratio
    # It undoes the delay of the label
    label_error = np.sqrt(np.mean(np.sum((lemniscate.chi - lemniscate.truth)[:, :3] ** 2, axis=1)))
    assert rows[0]["force_rmse"] < 0.7 * label_error
    assert trained.model.system.K <= 24
    assert np.linalg.norm(trained.model.system.A, 2) < 1.0  # by construction


def lifted(model, window):
    """z now of samples (window, 12)."""
    encoder = model.encoder
    if isinstance(encoder, AdaptiveFamily):
        return encoder.read(window, encoder.mean)[1]
    return encoder(window[-1, :6])


def test_turning_the_flight_turns_the_forecast(trained, lemniscate):
    turn = np.zeros((12, 12))  # 90 degrees about the vertical, of [chi, zeta]
    for start in (0, 3, 6, 9):
        turn[start, start + 1], turn[start + 1, start], turn[start + 2, start + 2] = -1.0, 1.0, 1.0
    window = np.hstack([lemniscate.chi, lemniscate.zeta])[100 - trained.model.window : 100]
    s, zeta = trained.model.system, lemniscate.zeta[100:110]
    straight = s.C @ advance(lifted(trained.model, window), s.A, s.B, zeta)
    turned = s.C @ advance(lifted(trained.model, window @ turn.T), s.A, s.B, zeta @ turn[6:, 6:].T)
    np.testing.assert_allclose(turned, straight @ turn[:6, :6].T, atol=1e-9)


def test_the_seed_decides_and_progress_ascends_to_its_total(dithered):
    calls: list[tuple[int, int, float]] = []
    config = LiftedConfig(steps=12)
    first = train([dithered.segment], config, on_epoch=lambda *call: calls.append(call)).model
    again, other = (
        train([dithered.segment], dc.replace(config, seed=seed)).model for seed in (0, 1)
    )
    np.testing.assert_array_equal(again.system.B, first.system.B)
    np.testing.assert_array_equal(again.encoder.axes[0].encoder, first.encoder.axes[0].encoder)
    assert not np.array_equal(other.system.B, first.system.B)
    assert [call[:2] for call in calls] == [(n, 12) for n in range(1, 13)]
    assert all(np.isfinite(loss) for _, _, loss in calls)


@pytest.mark.parametrize(
    "config", [LiftedConfig(steps=400), PaperConfig(epochs=1)], ids=["lifted", "paper"]
)
def test_a_flight_that_shows_nothing_teaches_to_hold(config):
    still = Segment(np.tile([0.0, 0.0, -2.5, 0.0, 0.0, 0.0], (300, 1)), np.zeros((300, 6)), 0.02)
    model = train([still], config).model
    s, z = model.system, lifted(model, np.hstack([still.chi, still.zeta])[: model.window])
    for steps in (0, 10, 40):
        later = s.C @ advance(z, s.A, s.B, np.ones((steps, 6)))
        assert later[2] == pytest.approx(-2.5, abs=0.1)  # [N]
    assert "0 of 6" in model.summary["excitation"]


def test_configurations_go_by_name_and_suit_their_axes():
    assert make_config("paper", epochs=3).epochs == 3
    assert make_config("", frame="body") == make_config("mode-dictionary", frame="body")
    for arguments, match in (
        ({"configuration": "theirs"}, r"lifted \| paper \| .*; got theirs"),
        ({"configuration": "paper", "epocs": 3}, "has no setting epocs"),
        ({"configuration": "mode-dictionary"}, "world axes need lifted"),
        ({"configuration": "lifted", "frame": "moon"}, "frame must be"),
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


def test_b_is_shrunk_where_the_flight_said_nothing(plain, trained, monkeypatch):
    """Unguarded, believed in every direction, the same flight teaches to answer v_z with force."""
    config = LiftedConfig(steps=300)
    assert vertical_gain(train([plain.segment], config).model) < 0.1
    assert vertical_gain(trained.model) > 0.1
    monkeypatch.setattr(
        family_training,
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
