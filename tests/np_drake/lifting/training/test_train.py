import dataclasses as dc

import numpy as np
import pytest

from np_drake.lifting.training.family_training import LiftedConfig
from np_drake.lifting.training.paper_training import PaperConfig
from np_drake.lifting.training.train import make_config, train
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.skill.skill import SkillRow, skill_table
from np_drake.training_data.segments import Segment, group_scale, white_noise

HORIZONS = [0, 5, 10, 20, 40]


def force_rows(model, flight, name: str = "np") -> list[SkillRow]:
    rows = skill_table(
        {"np": NeuralPredictor(model)},
        flight.chi,
        flight.zeta,
        target=flight.truth,
        horizons=HORIZONS,
        mean=np.zeros(6),
    )
    return [row for row in rows if row.model == name]


def same(a, b) -> bool:
    pairs = [(a.system.A, b.system.A), (a.system.B, b.system.B), (a.system.C, b.system.C)]
    return all(np.array_equal(x, y) for x, y in pairs) and np.array_equal(
        a.linear_encoder.E, b.linear_encoder.E
    )


def test_on_an_unseen_path_it_predicts_far_better_than_holding(trained, lemniscate):
    found = {row.horizon: row.force_ratio for row in force_rows(trained.model, lemniscate)}
    for horizon, ratio in {0: 0.7, 5: 0.6, 10: 0.5, 20: 0.35, 40: 0.25}.items():
        assert found[horizon] < ratio


def test_a_threefold_run_is_no_better(trained, dithered, lemniscate):
    longer = train([dithered.segment], LiftedConfig(steps=3 * LiftedConfig().steps)).model
    for short, long in zip(
        force_rows(trained.model, lemniscate), force_rows(longer, lemniscate), strict=True
    ):
        assert short.force_rmse < 1.05 * long.force_rmse


def test_at_most_24_states_stable_by_construction(trained):
    assert trained.model.system.K <= 24
    assert np.linalg.norm(trained.model.system.A, 2) < 1.0


@pytest.fixture(scope="module")
def briefly(dithered):
    """A training of a few steps: what it was told, and what came of it."""
    config = LiftedConfig(steps=12)
    return config, train([dithered.segment], config)


def test_the_same_seed_gives_the_same_model(briefly, dithered):
    config, expected = briefly
    assert same(train([dithered.segment], config).model, expected.model)
    assert not same(train([dithered.segment], dc.replace(config, seed=1)).model, expected.model)


def test_progress_ascends_to_its_total(dithered):
    calls: list[tuple[int, int, float]] = []
    config = LiftedConfig(steps=12)
    train([dithered.segment], config, on_epoch=lambda *call: calls.append(call))
    epochs = [epoch for epoch, _, _ in calls]
    assert epochs == sorted(set(epochs))
    assert epochs[-1] == calls[0][1]
    assert all(np.isfinite(loss) for _, _, loss in calls)


def test_turning_the_flight_turns_the_forecast(trained, lemniscate):
    turn = np.zeros((12, 12))  # 90 degrees about the vertical, of [chi, zeta]
    for start in (0, 3, 6, 9):
        turn[start, start + 1], turn[start + 1, start], turn[start + 2, start + 2] = -1.0, 1.0, 1.0
    window = np.hstack([lemniscate.chi, lemniscate.zeta])[100 - trained.model.window : 100]
    system, zeta = trained.model.system, lemniscate.zeta[100:110]
    straight = system.rollout(trained.model.lift(window), zeta)
    turned = system.rollout(trained.model.lift(window @ turn.T), zeta @ turn[6:, 6:].T)
    np.testing.assert_allclose(turned, straight @ turn[:6, :6].T, atol=1e-9)


def test_it_learns_to_undo_the_delay_of_the_label(trained, lemniscate):
    now = force_rows(trained.model, lemniscate)[0]
    label_error = np.sqrt(np.mean(np.sum((lemniscate.chi - lemniscate.truth)[:, :3] ** 2, axis=1)))
    assert now.force_rmse < 0.7 * label_error


@pytest.mark.parametrize(
    "change, match",
    [
        ({"chi": np.zeros((100, 5))}, r"chi must be \(n, 6\)"),
        ({"zeta": np.zeros((99, 6))}, r"zeta must be \(n, 6\)"),
        ({"chi": np.full((100, 6), np.nan)}, "chi must be finite; row 0"),
        ({"step": 0.0}, "step must be positive"),
    ],
)
def test_unusable_segments_are_named(change, match):
    segment = Segment(np.zeros((100, 6)), np.zeros((100, 6)), 0.02)
    with pytest.raises(ValueError, match=match):
        train([dc.replace(segment, **change)])


def test_too_little_or_mixed_data_is_refused():
    short = Segment(np.zeros((50, 6)), np.zeros((50, 6)), 0.02)
    with pytest.raises(ValueError, match="at least 91 samples"):
        train([short])
    with pytest.raises(ValueError, match="share one step"):
        train([short, dc.replace(short, step=0.04)])
    with pytest.raises(ValueError, match="at least one"):
        train([])


@pytest.mark.parametrize(
    "config", [LiftedConfig(steps=1000), PaperConfig(epochs=1)], ids=["lifted", "paper"]
)
def test_a_flight_that_shows_nothing_teaches_to_hold(config):
    still = Segment(np.tile([0.0, 0.0, -2.5, 0.0, 0.0, 0.0], (300, 1)), np.zeros((300, 6)), 0.02)
    model = train([still], config).model
    window = np.hstack([still.chi, still.zeta])[: model.window]
    chi = model.system.rollout(model.lift(window), np.ones((41, 6)))
    np.testing.assert_allclose(chi[:, 2], -2.5, atol=0.05)  # [N]
    assert "0 of 6" in model.summary["excitation"]


def test_configurations_go_by_name():
    assert make_config("paper", epochs=3).epochs == 3
    with pytest.raises(ValueError, match=r"lifted \| paper \| .*; got theirs"):
        make_config("theirs")
    with pytest.raises(ValueError, match="has no setting epocs"):
        make_config("paper", epocs=3)


def test_white_noise_is_told_from_motion():
    t = np.arange(2000) * 0.02
    noise = 0.03 * np.random.default_rng(0).standard_normal((2000, 1))
    assert white_noise([np.sin(3.0 * t)[:, None] + noise]) == pytest.approx(0.03, rel=0.1)


def test_a_group_of_channels_has_one_scale():
    values = np.random.default_rng(0).standard_normal((500, 6)) * [3, 4, 0, 1, 1, 1] + 5.0
    scale = group_scale([values], centred=True)
    np.testing.assert_allclose(scale[:3], np.sqrt(25 / 3), rtol=0.1)
    assert group_scale([np.zeros((10, 6))], centred=True).tolist() == [1.0] * 6
