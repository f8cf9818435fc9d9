import numpy as np

from np_drake.residual_model import Sample
from np_drake.skill.naive import LinearExtrapolation, TrainingMean

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
    dut = TrainingMean(RATE, step=0.02)
    chi = dut.forecast(fed(dut, [7 * RATE]), horizon=3, stride=1).rollout(np.ones((3, 6)))
    np.testing.assert_array_equal(chi, np.tile(RATE, (3, 1)))
