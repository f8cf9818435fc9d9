import numpy as np
import pytest
import torch

from np_drake.lifting.model.lifted_model import PAPER
from np_drake.lifting.training.checkpoint import Checkpoint
from np_drake.lifting.training.paper_training import PaperConfig, PaperTrainer, _stable, _window_fit
from np_drake.lifting.training.train import train

CONFIG = PaperConfig(epochs=2, spacing=20)


@pytest.fixture(scope="module")
def paper(dithered):
    return train([dithered.segment], CONFIG)


def test_the_loss_falls(paper):
    assert paper.loss[-1] < paper.loss[0]


def test_the_model_is_what_theorem_1_assumes(paper):
    assert paper.model.configuration == PAPER
    assert paper.model.encoder.lipschitz_bound <= CONFIG.gamma * (1 + 1e-12)
    assert paper.model.system.spectral_radius < 1.0
    assert paper.model.system.K == 24


def test_chi_is_read_out_of_z_without_bias(paper, lemniscate):
    error = paper.model.encoder(lemniscate.chi) @ paper.model.system.C.T - lemniscate.chi
    assert np.sqrt(np.mean(error[:, :3] ** 2)) < 0.03  # [N] of a payload's 2.5 N
    assert not paper.model.encoder(np.zeros(6)).any()


def test_runs_are_deterministic_and_resumable(paper, dithered, tmp_path):
    class Stop(Exception):
        pass

    def stop(*_):
        raise Stop

    checkpoint = tmp_path / "run.safetensors"
    with pytest.raises(Stop):
        train([dithered.segment], CONFIG, checkpoint=checkpoint, on_epoch=stop)
    resumed = train([dithered.segment], CONFIG, checkpoint=checkpoint)
    assert resumed.loss == paper.loss
    for name in "ABC":
        ours, theirs = getattr(resumed.model.system, name), getattr(paper.model.system, name)
        np.testing.assert_array_equal(ours, theirs)


def test_a_window_fit_is_ridge_regression_toward_the_prior():
    generator = torch.Generator().manual_seed(0)
    X = torch.randn(3, 39, 10, generator=generator, dtype=torch.float64)
    Y = torch.randn(3, 39, 4, generator=generator, dtype=torch.float64)
    prior = 0.1 * torch.randn(10, 4, generator=generator, dtype=torch.float64)
    A, B = _window_fit(X, Y, prior, 2.0)
    for i in range(3):
        stacked = np.vstack([X[i], np.sqrt(2.0) * np.eye(10)])
        target = np.vstack([Y[i], np.sqrt(2.0) * prior])
        expected = np.linalg.lstsq(stacked, target, rcond=None)[0]
        np.testing.assert_allclose(torch.cat([A[i], B[i]]), expected, atol=1e-10)


def test_an_unstable_window_is_scaled_onto_the_circle():
    A = _stable(torch.diag(torch.tensor([1.5, 0.5], dtype=torch.float64)))
    np.testing.assert_allclose(A.diagonal(), [0.9999, 0.3333], atol=1e-4)


def test_a_linear_system_costs_nothing_forward():
    """With z a lifted linear system that the prior knows, the rollout from its first state is exact."""
    generator = np.random.default_rng(0)
    A, B = 0.9 * np.linalg.qr(generator.standard_normal((4, 4)))[0], generator.standard_normal((4, 6))
    zeta = generator.standard_normal((1, 40, 6))
    z = np.zeros((1, 40, 4))
    z[0, 0] = 1.0
    for k in range(39):
        z[0, k + 1] = A @ z[0, k] + B @ zeta[0, k]
    dut = object.__new__(PaperTrainer)
    dut.config = CONFIG
    prior = torch.from_numpy(np.hstack([A, B]).T)
    arguments = torch.from_numpy(z), torch.from_numpy(zeta), prior
    assert dut._rollout_error(*arguments, backward=False).item() == pytest.approx(0.0, abs=1e-18)


def test_a_finished_run_has_nothing_left_to_do(dithered, tmp_path):
    checkpoint = Checkpoint(tmp_path / "run.safetensors", CONFIG, [dithered.segment])
    trainer = PaperTrainer([dithered.segment], CONFIG)
    trainer.run_epoch()
    checkpoint.save(trainer.state())
    again = PaperTrainer([dithered.segment], CONFIG)
    again.restore(checkpoint.load())
    assert again.epoch == 1
    assert again.run_epoch() == trainer.run_epoch()
