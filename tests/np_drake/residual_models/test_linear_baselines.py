"""Laws of the baseline that is fitted in closed form."""

import numpy as np
import pytest

from np_drake.residual_model import Sample
from np_drake.residual_models.linear_baselines import GROUPS, fit_force_ridge
from np_drake.training_data.segments import Segment

UNITS = 10.0 ** np.linspace(-3, 3, 12)


def swinging(seed, n=300):
    """Every channel a level and oscillations of two frequencies, with phases and sizes of its
    own.
    """
    draw, t = np.random.default_rng(seed), 0.02 * np.arange(n)
    phases, sizes = draw.uniform(0, 2 * np.pi, (2, 12, 1)), draw.uniform(0.5, 1.5, (2, 12, 1))
    samples = sizes[0] * np.sin(4.4 * t + phases[0]) + sizes[1] * np.sin(9.0 * t + phases[1]) + 0.3
    return Segment(*np.split(UNITS * samples.T, 2, axis=1), 0.02)


def test_the_label_is_held_until_the_window_is_full_or_while_missing():
    dut = fit_force_ridge([swinging(0)], span=0.2, horizon=0.4)
    memory, x = dut.initial_memory(), np.zeros(13)
    for chi in (np.ones(6), np.full(6, np.nan)):
        memory = dut.update(memory, Sample(x, np.zeros(4), chi))
    np.testing.assert_array_equal(memory["window"][-1, :6], 1.0)
    held = dut.forecast(memory, horizon=3, stride=1).rollout(np.zeros((3, 6)))
    np.testing.assert_array_equal(held, 1.0)


def test_the_force_ridge_forecasts_an_oscillation_by_groups_of_channels():
    segments, options = [swinging(seed) for seed in range(8)], {"span": 0.6, "horizon": 1.0}
    dut, unseen = fit_force_ridge(segments, **options), swinging(99)
    window = np.hstack([unseen.chi, unseen.zeta])[70:100]
    memory = {"window": window, "count": np.array([30.0])}
    before = dut.forecast(memory, horizon=51, stride=1).offset
    # Horizons 53 ms apart: w² h² / 8 = 3 % of the faster oscillation; the ridge shrinks the rest
    assert np.sqrt(np.mean(((before - unseen.chi[99:150]) / UNITS[:6]) ** 2)) < 0.2
    for outputs, inputs in GROUPS:
        others = [c for c in range(12) if c not in inputs]
        changed = window.copy()
        changed[:, others] += 1.0
        after = dut.forecast({**memory, "window": changed}, horizon=51, stride=1).offset
        np.testing.assert_array_equal(after[:, outputs], before[:, outputs])
    with pytest.raises(ValueError, match="at least 81 samples"):
        fit_force_ridge([swinging(0, n=80)], **options)
