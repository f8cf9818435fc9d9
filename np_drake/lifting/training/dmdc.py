"""Dynamic mode decomposition with control: chi+ from the last samples of chi and zeta by least
squares.

Nothing keeps it stable. As a baseline it is left so; as a configuration that flies it is projected
(`train`).       Source: Proctor, Brunton, Kutz 2016, delays as states.
"""

from collections.abc import Sequence

import numpy as np

from np_drake.lifting.model.delay_taps import DelayTaps
from np_drake.lifting.model.encoders import DelayEncoder
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.training_data.segments import Segment, check_segments, group_scale


def fit_dmdc_system(
    segments: Sequence[Segment], delays: int = 1
) -> tuple[LiftedLinearSystem, DelayEncoder]:
    """Fit the system of z = [chi now, chi before, …, zeta before, …] over the last `delays`
    samples.

    The coming zeta is the input.

    Args:
        delays: samples that the system sees [1].
    """
    segments = check_segments(list(segments), delays + 1)
    scale = sample_scale(segments)
    taps = DelayTaps(delays, delays, 0)
    X, Y = [], []
    for segment in segments:
        samples = np.hstack([segment.chi, segment.zeta]) / scale
        X.append(taps.features(samples, np.arange(delays - 1, len(samples) - 1)))
        Y.append(samples[delays:, :6])
    # chi+ = theta [chi; zeta] by least squares over all samples; small singular values are cut off
    theta = np.linalg.lstsq(np.concatenate(X), np.concatenate(Y), rcond=1e-10)[0]
    weights = theta.T.reshape(6, delays, 12) * scale[:6, None, None] / scale  # newest sample first
    system, E = _shift_register(weights, segments[0].step)
    return system, DelayEncoder(E, delays)


def sample_scale(segments: Sequence[Segment], wrench: str = "chi") -> np.ndarray:
    """Return scales of a sample [chi, zeta], (12,): one each for force, torque, v and omega [N,
    N·m, m/s, rad/s].
    """
    chi = group_scale([getattr(segment, wrench) for segment in segments], centred=True)
    return np.concatenate([chi, group_scale([segment.zeta for segment in segments], centred=True)])


def _shift_register(weights: np.ndarray, step: float) -> tuple[LiftedLinearSystem, np.ndarray]:
    """Return system and E (K, 12 D) of chi+ = sum over d of weights[:, d] [chi_(k-d), zeta_(k-d)].

    K = 12 D - 6.
    """
    D = weights.shape[1]
    K, past = 12 * D - 6, 6 * D  # where the past zeta begin
    A, B, E = np.zeros((K, K)), np.zeros((K, 6)), np.zeros((K, D, 12))
    A[:6, :past] = weights[:, :, :6].reshape(6, -1)
    A[:6, past:] = weights[:, 1:, 6:].reshape(6, -1)
    B[:6] = weights[:, 0, 6:]
    A[6:past, : past - 6] = np.eye(past - 6)
    if D > 1:
        B[past : past + 6] = np.eye(6)
        A[past + 6 :, past : K - 6] = np.eye(K - past - 6)
    for d in range(D):
        E[6 * d : 6 * d + 6, D - 1 - d, :6] = np.eye(6)
        if d > 0:
            E[past + 6 * (d - 1) : past + 6 * d, D - 1 - d, 6:] = np.eye(6)
    return LiftedLinearSystem(A, B, np.eye(6, K), step), E.reshape(K, -1)
