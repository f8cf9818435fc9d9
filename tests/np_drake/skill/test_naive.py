import numpy as np
import pytest

from np_drake.residual_model import Sample
from np_drake.residual_models.hold import Constant
from np_drake.skill.naive import GROUPS, LinearExtrapolation, RidgeConfig, fit_force_ridge
from np_drake.training_data.segments import Segment

LEVEL = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0, 0, 0, 0, 0, 0])
RATE = np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])


def fed(dut, labels):
    memory = dut.initial_memory()
    for chi in labels:
        memory = dut.update(memory, Sample(LEVEL, np.zeros(4), chi))
    return memory


def test_linear_extrapolation_is_exact_on_a_line_even_where_a_label_lacks():
    dut = LinearExtrapolation(step=0.02)
    labels = [k * RATE for k in range(6)]
    labels[5] = np.full(6, np.nan)
    chi = dut.forecast(fed(dut, labels), horizon=4, stride=2).rollout(np.zeros((4, 6)))
    np.testing.assert_allclose(chi, np.outer([5, 7, 9, 11], RATE), atol=1e-12)


def test_after_one_label_linear_extrapolation_holds_it():
    dut = LinearExtrapolation(step=0.02)
    chi = dut.forecast(fed(dut, [RATE]), horizon=4, stride=1).rollout(np.zeros((4, 6)))
    np.testing.assert_array_equal(chi, np.tile(RATE, (4, 1)))


def test_the_mean_ignores_every_label():
    dut = Constant(RATE, step=0.02, name="training mean")
    chi = dut.forecast(fed(dut, [7 * RATE]), horizon=3, stride=1).rollout(np.ones((3, 6)))
    np.testing.assert_array_equal(chi, np.tile(RATE, (3, 1)))


STEP = 0.02
CONFIG = RidgeConfig(noise=1e-3)


def swinging(seed, n=300):
    """Every channel a level and oscillations of two frequencies, with phases and sizes of its
    own.
    """
    draw, t = np.random.default_rng(seed), STEP * np.arange(n)
    phases, sizes = draw.uniform(0, 2 * np.pi, (2, 12, 1)), draw.uniform(0.5, 1.5, (2, 12, 1))
    samples = sizes[0] * np.sin(4.4 * t + phases[0]) + sizes[1] * np.sin(9.0 * t + phases[1]) + 0.3
    return Segment(samples[:6].T, samples[6:].T, STEP)


def fed_segment(dut, segment, n):
    memory = dut.initial_memory()
    for k in range(n):
        x = np.concatenate([[0, 0, 0, 1, 0, 0, 0], segment.zeta[k]])
        memory = dut.update(memory, Sample(x, np.zeros(4), segment.chi[k]))
    return memory


def test_the_ridge_forecasts_an_oscillation_of_another_phase():
    dut, flight = fit_force_ridge([swinging(seed) for seed in range(8)], CONFIG), swinging(99)
    chi = dut.forecast(fed_segment(dut, flight, 100), horizon=51, stride=1).rollout(
        np.zeros((51, 6))
    )
    # Linear interpolation between horizons 53 ms apart: w² h² / 8 = 3 % of the faster oscillation.
    np.testing.assert_allclose(chi, flight.chi[99:150], atol=0.1)


def test_a_channel_is_forecast_from_those_of_its_group_alone():
    dut, flight = fit_force_ridge([swinging(seed) for seed in range(8)], CONFIG), swinging(99)
    memory = fed_segment(dut, flight, 100)
    before = dut.forecast(memory, horizon=51, stride=1).offset
    for group in GROUPS:
        others = [c for c in range(12) if c not in group.inputs]
        window = memory["window"].copy()
        window[:, others] += 1.0
        after = dut.forecast({**memory, "window": window}, horizon=51, stride=1).offset
        np.testing.assert_array_equal(after[:, group.outputs], before[:, group.outputs])


def test_until_the_window_is_full_the_label_is_held():
    dut, flight = fit_force_ridge([swinging(seed) for seed in range(8)], CONFIG), swinging(99)
    offset = dut.forecast(fed_segment(dut, flight, 29), horizon=5, stride=1).offset
    np.testing.assert_array_equal(offset, np.tile(flight.chi[28], (5, 1)))


def test_a_flight_shorter_than_window_and_horizon_is_refused():
    with pytest.raises(ValueError, match="at least 81 samples"):
        fit_force_ridge([swinging(0, n=80)], CONFIG)
