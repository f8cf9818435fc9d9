import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.lifting.training.delay_regression import Regularisation, compress, horizon_weights
from np_drake.lifting.training.modal_fit import RIDGE, ModalBlock, descend

HORIZONS = np.array([0, 1, 2, 5, 8])
NOTHING = Regularisation(0.0, 0.0, 0.0, 0.0, 0.0)
DELAY = 3


def piece(n: int = 400, seed: int = 0):
    """Labels (n, 2), inputs (n, 2), goals (n, 1): an oscillator driven by the inputs, seen with noise."""
    generator = np.random.default_rng(seed)
    inputs = generator.standard_normal((n, 2))
    A = 0.95 * np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    z, goal = np.zeros((n, 2)), np.zeros((n, 1))
    for k in range(n - 1):
        z[k + 1] = A @ z[k] + np.array([[0.3, 0.0], [0.1, -0.2]]) @ inputs[k]
    goal[:, 0] = z @ [1.0, 0.5]
    labels = np.hstack([goal, z @ [[0.2], [1.0]]]) + 0.1 * generator.standard_normal((n, 2))
    return labels, inputs, goal


def block(regularisation: Regularisation = NOTHING, horizons: np.ndarray = HORIZONS) -> ModalBlock:
    regression = compress([piece()], delay=DELAY, horizons=horizons, regularisation=regularisation, max_origins=10_000)
    return ModalBlock(regression, size=4, pairs=1, step=0.02)


def simulated_loss(dut: ModalBlock, theta: np.ndarray, labels, inputs, goals) -> float:
    """The loss by its definition: every origin, step by step."""
    m = dut.matrices(theta)
    samples = np.hstack([labels, inputs])
    weights = horizon_weights([(labels, inputs, goals)], HORIZONS)
    total, origins = 0.0, range(DELAY - 1, len(labels) - HORIZONS[-1])
    for k in origins:
        z = m.E @ samples[k - DELAY + 1 : k + 1].ravel()
        total += RIDGE * z @ z
        for i in range(HORIZONS[-1] + 1):
            if i in HORIZONS:
                error = m.C @ z - goals[k + i]
                total += weights[list(HORIZONS).index(i)] ** 2 * error @ error
            z = m.A @ z + m.B @ inputs[k + i]
    return (total / len(origins) + RIDGE * np.sum(m.B**2)) / len(HORIZONS)


@pytest.mark.parametrize("seed", range(3))
def test_the_compressed_loss_is_the_loss_over_all_origins(seed):
    dut = block()
    theta = dut.initial_theta(np.random.default_rng(seed))
    loss, _ = dut.loss_and_gradient(theta)
    assert loss == pytest.approx(simulated_loss(dut, theta, *piece()), rel=1e-5)  # 1e-11 on a diagonal


def test_no_other_encoder_does_better():
    dut = block()
    theta = dut.initial_theta(np.random.default_rng(0))
    best, matrices = simulated_loss(dut, theta, *piece()), dut.matrices(theta)
    shake = np.random.default_rng(1).standard_normal(matrices.E.shape)
    for size in (-1e-2, 1e-2):
        dut.matrices = lambda _, size=size: type(matrices)(
            matrices.E + size * shake, matrices.A, matrices.B, matrices.C
        )
        assert simulated_loss(dut, theta, *piece()) > best


def test_the_gradient_is_that_of_the_loss():
    dut = block(Regularisation())
    theta = dut.initial_theta(np.random.default_rng(0))
    _, gradient = dut.loss_and_gradient(theta)
    for direction in np.random.default_rng(1).standard_normal((3, len(theta))):
        ahead, behind = (dut.loss_and_gradient(theta + h * direction)[0] for h in (1e-6, -1e-6))
        assert (ahead - behind) / 2e-6 == pytest.approx(gradient @ direction, rel=1e-5, abs=1e-9)


@given(st.integers(0, 10_000), st.floats(0.1, 30.0))
@settings(max_examples=25)
def test_a_is_stable_whatever_the_parameters(seed, size):
    theta = size * np.random.default_rng(seed).standard_normal(len(DUT.initial_theta(np.random.default_rng(0))))
    A = DUT.matrices(theta).A
    assert np.linalg.norm(A, 2) < 1.0  # not only the eigenvalues: no transient growth either
    assert np.all(np.isfinite(A))


def test_levels_hold_and_are_not_driven():
    m = DUT.matrices(DUT.initial_theta(np.random.default_rng(0)))
    assert m.A[-1, -1] ** 50 > 0.99  # one second
    assert not m.B[-1].any()


def test_the_rollout_of_the_matrices_is_what_the_loss_sees():
    m = DUT.matrices(DUT.initial_theta(np.random.default_rng(0)))
    theta = torch.tensor(DUT.initial_theta(np.random.default_rng(0)))
    a, angle, real, C, _ = DUT._parts(theta)
    powers = DUT._output_powers(a, angle, real, C, torch.arange(4.0, dtype=torch.float64)).numpy()
    scale = DUT._column_length(C).numpy()
    for i in range(4):
        np.testing.assert_allclose(powers[i] / scale, m.C @ np.linalg.matrix_power(m.A, i), atol=1e-12)


def test_an_oscillator_is_identified():
    dut = block(NOTHING, np.arange(21))
    theta, losses = descend(dut, dut.initial_theta(np.random.default_rng(0)), iterations=200)
    assert losses[-1] < 0.1  # persistence: 1
    eigenvalues = np.linalg.eigvals(dut.matrices(theta).A)
    found = eigenvalues[np.argmax(eigenvalues.imag)]
    assert abs(np.angle(found)) == pytest.approx(0.3, rel=0.1)


def test_white_noise_in_the_labels_shrinks_the_encoder():
    quiet, noisy = (block(Regularisation(label_noise=gain)) for gain in (1.0, 20.0))
    theta = quiet.initial_theta(np.random.default_rng(0))
    assert np.linalg.norm(noisy.matrices(theta).E) < np.linalg.norm(quiet.matrices(theta).E)


DUT = block()
