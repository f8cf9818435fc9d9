"""Laws of what a jump of the modes shows, and of what it does to z."""

import numpy as np
import pytest

from np_drake.lifting.training.modal_fit import BlockMatrices
from np_drake.lifting.training.onset_fit import fit_onsets, label_lag, stack_onsets

D, K, SIZE, LAG = 8, 3, 1.5, 0.6
MODES, AGES = np.array([0, 2]), (0, 3, 6, D, D + 5)  # the last two before the window
RNG = np.random.default_rng(0)
ROOT = RNG.standard_normal((2 * D, 2 * D)) + 3.0 * np.eye(2 * D)
MOMENT = ROOT @ ROOT.T  # of ordinary windows (D samples of a label and an input)
CROSS = RNG.standard_normal((K, 2 * D))  # of z and the window
A = np.array([[0.9, -0.2, 0.0], [0.2, 0.9, 0.0], [0.0, 0.0, 0.99]])
M = BlockMatrices(CROSS @ np.linalg.inv(MOMENT), A, np.zeros((K, 1)), np.array([[0.6, 0.8, 1.0]]))


def fitted(lag: float = LAG):
    whitener = np.linalg.cholesky(MOMENT)
    return fit_onsets(M, whitener, modes=MODES, ages=AGES, delay=D, size=SIZE, lag=lag)


def shown(age: int, lag: float = LAG) -> np.ndarray:
    """(2 D, 2) a window `age` samples after jumps of size one, by simulation."""
    course = np.zeros((2 * D, 2, len(MODES)))
    for j, mode in enumerate(MODES):
        z, label = SIZE * np.eye(K)[mode], 0.0
        for k in range(2 * D - 1 - age, 2 * D):
            label = lag * label + (1 - lag) * (M.C @ z)[0]
            course[k, 0, j], z = label, A @ z
    return course[D:].reshape(2 * D, -1)


@pytest.mark.parametrize("r", range(len(AGES)))
def test_it_is_the_best_linear_encoder_of_windows_with_such_a_jump(r):
    dut, J = fitted(), shown(AGES[r])
    moment = MOMENT + J @ J.T
    cross = CROSS + SIZE * np.linalg.matrix_power(A, AGES[r])[:, MODES] @ J.T
    np.testing.assert_allclose(M.E + dut.jump[r] @ dut.watch[r], np.linalg.solve(moment, cross.T).T, atol=1e-10)


@pytest.mark.parametrize("r", range(len(AGES)))
def test_the_likelihood_is_that_of_the_two_gaussians(r):
    dut, J, window = fitted(), shown(AGES[r]), RNG.standard_normal(2 * D)

    def logarithm(S):
        return -0.5 * (window @ np.linalg.solve(S, window) + np.linalg.slogdet(S)[1])

    ratio = logarithm(MOMENT + J @ J.T) - logarithm(MOMENT)
    seen = dut.watch[r] @ window
    assert 0.5 * seen @ seen - dut.cost[r] == pytest.approx(ratio, abs=1e-10)


def test_a_jump_of_this_very_sample_shows_in_the_newest_label_alone():
    watch = fitted(lag=0.0).watch[0]
    J = shown(0, lag=0.0)
    assert np.count_nonzero(J.any(axis=1)) == 1
    assert np.linalg.matrix_rank(watch) == 1  # one number cannot tell two modes apart


def test_the_lag_of_a_first_order_label_is_found():
    goal = np.cumsum(RNG.standard_normal((400, 2)), axis=0)
    label = np.zeros_like(goal)
    for k in range(1, 400):
        label[k] = LAG * label[k - 1] + (1 - LAG) * goal[k]
    assert label_lag([(label, goal), (label[50:], goal[50:])]) == pytest.approx(LAG, abs=1e-12)


def test_a_label_that_is_its_target_or_stands_still_has_no_lag():
    goal = RNG.standard_normal((50, 1))
    assert label_lag([(goal, goal)]) == 0.0
    assert label_lag([(np.ones((50, 1)), np.ones((50, 1)))]) == 0.0


def test_a_view_of_fewer_channels_is_the_same_among_others():
    narrow, rng = fitted(), np.random.default_rng(3)
    channels = rng.standard_normal((2, 12))
    R = len(AGES)
    wide = type(narrow)(rng.standard_normal((R, 4, D * 5)), np.ones(R), rng.standard_normal((R, K, 4)))
    alone = stack_onsets([(channels, narrow)], 0.1)
    both = stack_onsets([(rng.standard_normal((5, 12)), wide), (channels, narrow)], 0.1)
    window = rng.standard_normal((D, 12))
    np.testing.assert_allclose(both.correction(window)[K:], alone.correction(window), atol=1e-12)
    assert both.K == 2 * alone.K == 2 * K
