"""Training of the linear baselines in closed form: `dmdc`, `delay-dmdc` and `ridge`.

They are the baselines of every table as lifted linear systems that can fly: made stable, in a model file, through the
same predictor as the others.
"""

import dataclasses as dc
from collections.abc import Callable

import numpy as np

from np_drake.lifting.model.delay_taps import DelayTaps
from np_drake.lifting.model.encoders import DelayEncoder
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.model.lifted_model import DELAY_DMDC, DMDC, RIDGE, LiftedModel
from np_drake.lifting.training.checkpoint import Checkpoint
from np_drake.lifting.training.dmdc import fit_dmdc_system, sample_scale
from np_drake.lifting.training.excitation import measure_excitation
from np_drake.lifting.training.horizon_ridge import flight_moments, horizon_ridge, relative_error
from np_drake.training_data.segments import Segment, check_segments

OnEpoch = Callable[[int, int, float], None]


@dc.dataclass(frozen=True)
class DmdcConfig:
    """Parameters of `dmdc` (last sample) and `delay-dmdc` (last ten, as in the tables of `np-drake evaluate`)."""

    delays: int = 1  # samples that it sees [1]
    seed: int = 0  # nothing is drawn; kept for the one interface of all configurations


@dc.dataclass(frozen=True)
class RidgeConfig:
    """Parameters of `ridge`: for every horizon a separate map from past samples to the force.

    It ignores the coming zeta.
    """

    delay: int = 60  # samples that it sees [1]
    dense: int = 12  # of them one by one, the newest [1]
    averages: int = 11  # the others in so many averages [1]
    horizon: int = 40  # longest forecast; held beyond [steps]
    noise: float = 0.01  # of the samples, in units of their scale [1]
    max_origins: int = 6000  # of a segment; thinned beyond [1]
    seed: int = 0  # nothing is drawn; kept for the one interface of all configurations


def train_dmdc(
    segments: list[Segment], config: DmdcConfig, checkpoint: Checkpoint, on_epoch: OnEpoch = lambda *_: None
) -> tuple[LiftedModel, list[float]]:
    """Return (model, [mean square of the scaled error one step ahead]).

    The checkpoint is not used.
    """
    del checkpoint
    segments = check_segments(segments, config.delays + 1)
    system, encoder = fit_dmdc_system(segments, config.delays)
    scale = sample_scale(segments)
    stable = system.stabilized()
    loss = _one_step_error(segments, stable, encoder, scale)
    on_epoch(1, 1, loss)
    summary = _summary(segments, loss) | {"spectral_radius_as_fitted": system.spectral_radius}
    name = DMDC if config.delays == 1 else DELAY_DMDC
    model = LiftedModel(name, stable, encoder, config.delays, scale[:6], scale[6:], True, summary)
    return model, [loss]


def train_ridge(
    segments: list[Segment], config: RidgeConfig, checkpoint: Checkpoint, on_epoch: OnEpoch = lambda *_: None
) -> tuple[LiftedModel, list[float]]:
    """Return (model, [mean square error over that of the better naive row]).

    The checkpoint is not used.
    """
    del checkpoint
    segments = check_segments(segments, config.delay + config.horizon + 1)
    scale, taps = sample_scale(segments), DelayTaps(config.delay, config.dense, config.averages)
    horizons = np.arange(config.horizon + 1)
    flights = [
        flight_moments(
            np.hstack([s.chi, s.zeta]) / scale, s.goal / scale[:6], taps=taps, horizons=horizons,
            max_origins=config.max_origins, symmetry=0.0,
        )
        for s in segments
    ]  # fmt: skip
    W = horizon_ridge(flights, noise=config.noise)
    loss = float(np.mean([relative_error(flight, W)[:, 0] for flight in flights]))
    on_epoch(1, 1, loss)
    force = (W * scale[:6])[:, :, :3].transpose(1, 2, 0).reshape(3 * len(horizons), -1)
    E = taps.expand(force[:, :-1], 12).reshape(-1, config.delay, 12) / scale
    encoder = DelayEncoder(E.reshape(len(E), -1), config.delay, force[:, -1])
    system = course_register(config.horizon, segments[0].step)
    summary = _summary(segments, loss)
    return LiftedModel(RIDGE, system, encoder, config.delay, scale[:6], scale[6:], False, summary), [loss]


def course_register(horizon: int, step: float) -> LiftedLinearSystem:
    """Return the system whose state is a whole forecast of the force, chi_hat_0 … chi_hat_H.

    A shifts it by one step and holds it at its end, and B = 0. Any forecast that does not depend on the coming motion
    is such a lifted linear system, exactly.
    Args: horizon: H [steps].   step: [s].
    """
    K = 3 * (horizon + 1)
    A = np.eye(K, k=3)
    A[-3:, -3:] = np.eye(3)
    return LiftedLinearSystem(A, np.zeros((K, 6)), np.eye(6, K) * (np.arange(6) < 3)[:, None], step)


def _one_step_error(
    segments: list[Segment], system: LiftedLinearSystem, encoder: DelayEncoder, scale: np.ndarray
) -> float:
    errors = []
    for segment in segments:
        z = encoder.along(np.hstack([segment.chi, segment.zeta]))[:-1]
        first = len(segment) - len(z) - 1
        chi_hat = (z @ system.A.T + segment.zeta[first:-1] @ system.B.T) @ system.C.T
        errors.append((chi_hat - segment.chi[first + 1 :]) / scale[:6])
    return float(np.mean(np.concatenate(errors) ** 2))


def _summary(segments: list[Segment], loss: float) -> dict:
    text = measure_excitation([segment.zeta for segment in segments], step=segments[0].step).text
    return {"samples": sum(map(len, segments)), "loss": {"all": loss}, "excitation": text}
