import numpy as np
import pytest
import torch
from hypothesis import example, given
from hypothesis import strategies as st

from np_drake.lifting.training.paper_training import PhiModule

SCALE = np.array([2.0, 2.0, 2.0, 0.1, 0.1, 0.1])


def phi_module(seed: int = 0, gamma: float = 1.0, shake: float = 0.3) -> PhiModule:
    """Away from its initial weights, as after training."""
    dut = PhiModule(width=16, layers=2, K=8, gamma=gamma, scale=SCALE, seed=seed)
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for raw in dut.raw:
            raw += shake * torch.randn(raw.shape, generator=generator, dtype=raw.dtype)
    return dut


@given(st.integers(0, 1000), st.floats(0.1, 100.0), st.floats(0.0, 3.0))
@example(217, 1.0, 0.005859375)  # two singular values 1e-4 apart
def test_the_product_of_singular_values_is_at_most_gamma(seed, gamma, shake):
    dut = phi_module(seed, gamma, shake)
    product = np.prod([np.linalg.norm(W.detach().numpy(), 2) for W in dut.weights()])
    assert product <= gamma * (1 + 1e-12)  # rounding
    assert dut.export().lipschitz_bound <= gamma * (1 + 1e-12)


@given(st.integers(0, 1000), st.integers(0, 1000))
def test_phi_stretches_scaled_distances_at_most_by_gamma(seed, points):
    dut = phi_module(seed, 2.0).export()
    a, b = SCALE * np.random.default_rng(points).standard_normal((2, 6))
    assert np.linalg.norm(dut(a) - dut(b)) <= 2.0 * np.linalg.norm((a - b) / SCALE) * (1 + 1e-12)


def test_what_flies_is_what_was_trained():
    dut = phi_module()
    chi = SCALE * np.random.default_rng(0).standard_normal((50, 6))
    trained = dut(torch.from_numpy(chi)).detach().numpy()
    np.testing.assert_allclose(dut.export()(chi), trained, rtol=1e-6, atol=1e-9)


def test_without_bias_phi_is_positively_homogeneous():
    dut, chi = phi_module().export(), SCALE * np.random.default_rng(0).standard_normal(6)
    np.testing.assert_allclose(dut(3.0 * chi), 3.0 * dut(chi), rtol=1e-12)
    assert not dut(np.zeros(6)).any()


def test_fresh_weights_carry_chi_itself():
    dut = phi_module(shake=0.0).export()
    chi = SCALE * np.random.default_rng(0).standard_normal((100, 6))
    C = np.linalg.lstsq(dut(chi), chi, rcond=None)[0]
    np.testing.assert_allclose(dut(chi) @ C, chi, atol=1e-9)


def test_a_layer_of_one_direction_is_normalised_too():
    dut = phi_module()
    with torch.no_grad():
        dut.raw[1].copy_(torch.outer(torch.arange(16.0), torch.ones(16)))
    assert dut.export().lipschitz_bound <= 1.0 + 1e-12


def test_the_gradient_goes_through_the_normalisation():
    dut = phi_module()
    dut(torch.from_numpy(SCALE[None])).square().sum().backward()
    radial = torch.sum(dut.raw[0].grad * dut.raw[0].detach())  # a longer W is the same W_hat
    assert radial.item() == pytest.approx(0.0, abs=1e-9)
