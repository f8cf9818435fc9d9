"""Laws of whitening by a noise model, against its definition written out."""

import numpy as np
import pytest

from np_drake.diagnosis.numerics import NoiseModel

M, C, P = 40, 5, 3
ABSENT = 2  # channel that the logs lack


def a_model(seed: int) -> NoiseModel:
    rng = np.random.default_rng(seed)
    phi = rng.uniform(-0.3, 0.3, (C, P))
    phi[0] = 0.0  # white
    rms = rng.uniform(0.5, 2.0, C)
    mixing = np.tril(rng.standard_normal((C, C))) + 2 * np.eye(C)
    rms[ABSENT] = 0.0
    mixing[ABSENT] = mixing[:, ABSENT] = 0.0
    return NoiseModel(phi, mixing, rms, rms**2, 0.02, {"loud": np.arange(1.0, C + 1)})


def whitened(model: NoiseModel, values: np.ndarray, flight: str) -> np.ndarray:
    """Return mixing @ innovations, with e_t = y_t - sum_k phi_k y_(t-k) over the flight's
    loudness.
    """
    flat = values.reshape(M, C, -1)
    out = np.zeros((M - P, C, flat.shape[2]))
    loud = model.loudness.get(flight, np.ones(C))
    for t in range(P, M):
        past = sum(model.phi[:, k - 1, None] * flat[t - k] for k in range(1, P + 1))
        out[t - P] = model.mixing @ ((flat[t] - past) / loud[:, None])
    return out.reshape(M - P, *values.shape[1:])


@pytest.mark.parametrize("flight", ["quiet", "loud"])
@pytest.mark.parametrize("shape", [(), (4,), (2, 3)])
def test_whitened_channels_are_mixed_innovations(flight, shape):
    model, values = a_model(1), np.random.default_rng(2).standard_normal((M, C, *shape))
    np.testing.assert_allclose(
        model.whiten(values, flight), whitened(model, values, flight), atol=1e-12
    )


@pytest.mark.parametrize("flight", ["quiet", "loud"])
def test_columns_of_zeros_and_absent_channels_change_no_product(flight):
    rng, model = np.random.default_rng(3), a_model(4)
    groups = [rng.standard_normal((M, C, k)) for k in (3, 1, 2)]
    groups[0][:, 1] = 0.0  # one group does nothing in a channel
    groups[0][:, 3, 1] = 0.0  # one column of it does nothing in another
    groups[2][:, :ABSENT] = groups[2][:, ABSENT + 1 :] = 0.0  # acts in the absent channel alone
    white = whitened(model, np.concatenate(groups, axis=2), flight).reshape(-1, 6)
    np.testing.assert_allclose(model.products(groups, flight), white.T @ white, atol=1e-9)
    np.testing.assert_allclose(model.products(groups, flight)[4:], 0.0, atol=1e-12)


def test_the_spectrum_integrates_to_the_variance_of_the_process():
    a, variance = 0.6, 2.0
    model = NoiseModel(np.array([[a]]), np.eye(1), np.ones(1), np.array([variance]), 0.02)
    frequency = np.linspace(0.0, 25.0, 20001)
    power = np.trapezoid(model.spectrum(frequency)[0], frequency)
    assert power == pytest.approx(variance / (1 - a**2), rel=1e-4)
