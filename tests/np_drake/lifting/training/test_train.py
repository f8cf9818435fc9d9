import dataclasses as dc

import numpy as np
import pytest

from np_drake.lifting.training.delay_modal_training import DelayModalConfig
from np_drake.lifting.training.delay_regression import Regularisation
from np_drake.lifting.training.paper_training import PaperConfig
from np_drake.lifting.training.train import make_config, train
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.skill.skill import SkillRow, skill_table
from np_drake.training_data.segments import Segment, group_scale, white_noise

HORIZONS = [0, 5, 10, 20, 40]


def force_rows(model, flight, name: str = "np") -> list[SkillRow]:
    rows = skill_table(
        {"np": NeuralPredictor(model)}, flight.chi, flight.zeta, target=flight.truth, horizons=HORIZONS,
        mean=np.zeros(6),
    )  # fmt: skip
    return [row for row in rows if row.model == name]


def same(a, b) -> bool:
    pairs = [(a.system.A, b.system.A), (a.system.B, b.system.B), (a.system.C, b.system.C)]
    return all(np.array_equal(x, y) for x, y in pairs) and np.array_equal(a.encoder.E, b.encoder.E)


def test_on_an_unseen_path_it_predicts_far_better_than_holding(trained, lemniscate):
    found = {row.horizon: row.force_ratio for row in force_rows(trained.model, lemniscate)}
    for horizon, ratio in {0: 0.7, 5: 0.6, 10: 0.5, 20: 0.35, 40: 0.25}.items():
        assert found[horizon] < ratio


def test_a_tenfold_run_is_no_better(trained, dithered, lemniscate):
    config = DelayModalConfig(iterations=10 * DelayModalConfig().iterations, starts=10)  # each stops when converged
    longer = train([dithered.segment], config).model
    for short, long in zip(force_rows(trained.model, lemniscate), force_rows(longer, lemniscate), strict=True):
        assert short.force_rmse < 1.05 * long.force_rmse


def test_twelve_states_stable_by_construction(trained):
    assert trained.model.system.K == 12
    assert np.linalg.norm(trained.model.system.A, 2) < 1.0


@pytest.fixture(scope="module")
def briefly(dithered):
    """A training of a few iterations: what it was told, and what came of it."""
    config = DelayModalConfig(iterations=12, starts=2)
    return config, train([dithered.segment], config)


def test_the_same_seed_gives_the_same_model(briefly, dithered):
    config, expected = briefly
    assert same(train([dithered.segment], config).model, expected.model)
    assert not same(train([dithered.segment], dc.replace(config, seed=1)).model, expected.model)


def test_an_interrupted_run_ends_where_an_uninterrupted_one_does(briefly, dithered, tmp_path):
    config, expected = briefly

    class Stop(Exception):
        pass

    def stop(epoch, total, loss):
        if epoch > total // 2:
            raise Stop

    checkpoint = tmp_path / "run.safetensors"
    with pytest.raises(Stop):
        train([dithered.segment], config, checkpoint=checkpoint, on_epoch=stop)
    resumed = train([dithered.segment], config, checkpoint=checkpoint)
    assert same(resumed.model, expected.model)
    assert resumed.loss == expected.loss


def test_a_checkpoint_of_another_run_is_refused(dithered, plain, tmp_path):
    checkpoint = tmp_path / "run.safetensors"
    config = DelayModalConfig(iterations=2, starts=1)
    train([dithered.segment], config, checkpoint=checkpoint)
    for segments, other in (([plain.segment], config), ([dithered.segment], dc.replace(config, seed=1))):
        with pytest.raises(ValueError, match="checkpoint must be of this configuration and data"):
            train(segments, other, checkpoint=checkpoint)


def test_progress_ascends_to_its_total(dithered):
    calls: list[tuple[int, int, float]] = []
    config = DelayModalConfig(iterations=12, starts=2)
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


def test_where_constants_are_expected_an_unknown_constant_force_is_held(dithered):
    config = DelayModalConfig(regularisation=Regularisation(unknown_constant=10.0))
    model = train([dithered.segment], config).model
    window = np.zeros((model.window, 12))
    window[:, :3] = [0.5, -0.3, -2.0]  # [N], hovering
    chi = model.system.rollout(model.lift(window), np.zeros((41, 6)))
    np.testing.assert_allclose(chi[:, :3], np.tile([0.5, -0.3, -2.0], (41, 1)), atol=0.05)  # [N]


def begun(t0: int, course) -> np.ndarray:
    """(n, 12) hover with labels of a filter of 6 Hz and 0.03 N of noise; `course` of f_x, f_z begins at sample t0."""
    samples, blend, f = np.zeros((160, 12)), 1 - np.exp(-2 * np.pi * 6.0 * 0.02), np.zeros(6)
    samples[:, :3] = 0.03 * np.random.default_rng(5).standard_normal((160, 3))  # [N]
    for k in range(t0, 160):
        f[:3] += blend * (course(0.02 * (k - t0)) - f[:3])
        samples[k, :3] += f[:3]
    return samples


def forecast_errors(model, samples: np.ndarray, course, ages: range) -> float:
    """RMS [N] of the wrench 0.1 s ahead of the origins that are `ages` samples after the onset."""
    errors = []
    for age in ages:
        z = model.lift(samples[101 + age - model.window : 101 + age])
        ahead = model.system.rollout(z, np.zeros((6, 6)))[5, :3]
        errors.append(ahead - course(0.02 * (age + 5)))
    return float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.parametrize("name", ["swing", "weight"])
def test_what_begins_in_the_window_is_seen_before_a_linear_encoder_does(trained, name):
    courses = {
        "swing": lambda t: np.array([np.sin(2 * np.pi * 0.6 * t), 0.0, 0.0]),
        "weight": lambda t: np.array([0.0, 0.0, -1.0]),
    }
    course, ages = courses[name], range(10, 40)
    samples, plain = begun(100, course), dc.replace(trained.model, onsets=None)
    quick, slow = (forecast_errors(model, samples, course, ages) for model in (trained.model, plain))
    assert quick < 0.7 * slow


def test_a_motion_that_goes_on_is_left_to_the_linear_encoder(trained, dithered):
    samples = np.hstack([dithered.chi, dithered.zeta])[500:]
    windows = np.lib.stride_tricks.sliding_window_view(samples, trained.model.window, axis=0).swapaxes(1, 2)
    p = trained.model.onsets.probability(windows[::10])
    assert p[..., :2, :].sum(axis=-1).mean() < 0.2
    # That a level is the training's is no more likely than that it is an older one: both hold it.
    assert p[..., :-1].sum(axis=-1).mean() < 0.2


def test_a_wind_unseen_in_training_is_held_better_with_mixed_windows(trained, dithered):
    def wind(t):
        return np.array([5.0, 0.0, 0.0])  # [N]

    samples, ages = begun(100, wind), range(52, 58)  # the window of 50 samples is full of it
    without = train([dithered.segment], DelayModalConfig(other_odds=0.0)).model
    better, worse = (forecast_errors(model, samples, wind, ages) for model in (trained.model, without))
    assert better < 0.8 * worse


def test_without_odds_of_onsets_the_encoder_is_linear(dithered):
    config = DelayModalConfig(onset_odds=0.0, starts=1, iterations=2)
    assert train([dithered.segment], config).model.onsets is None


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


@pytest.mark.parametrize("config", [DelayModalConfig(), PaperConfig(epochs=1)], ids=["delay-modal", "paper"])
def test_a_flight_that_shows_nothing_teaches_to_hold(config):
    still = Segment(np.tile([0.0, 0.0, -2.5, 0.0, 0.0, 0.0], (300, 1)), np.zeros((300, 6)), 0.02)
    model = train([still], config).model
    window = np.hstack([still.chi, still.zeta])[: model.window]
    chi = model.system.rollout(model.lift(window), np.ones((41, 6)))
    np.testing.assert_allclose(chi[:, 2], -2.5, atol=0.05)  # [N]
    assert "0 of 6" in model.summary["excitation"]


def test_configurations_go_by_name():
    assert make_config("paper", epochs=3).epochs == 3
    with pytest.raises(ValueError, match=r"delay-modal \| paper \| .*; got theirs"):
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
