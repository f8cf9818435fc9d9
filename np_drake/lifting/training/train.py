"""Training of a predictor from plain arrays, with configurations by name, and of the baselines
among them.

`dmdc`, `delay-dmdc` and `ridge` are the linear baselines of every table as lifted linear systems
that can fly: fitted in closed form, made stable, in a model file, through the same predictor as the
others.
"""

import dataclasses as dc
from collections.abc import Callable

import numpy as np

from np_drake.lifting.model.encoders import DelayEncoder, DelayTaps
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.model.lifted_model import (
    BY_AXES,
    DELAY_DMDC,
    DMDC,
    FAMILIES,
    LIFTED,
    MODE_DICTIONARY,
    NEURAL,
    PAPER,
    RIDGE,
    LiftedModel,
)
from np_drake.lifting.training import OnEpoch
from np_drake.lifting.training.excitation import training_summary
from np_drake.lifting.training.family_training import LiftedConfig, train_lifted
from np_drake.lifting.training.linear_fits import fit_dmdc_system, sample_scale, window_ridge
from np_drake.lifting.training.mode_dictionary import ModeDictionaryConfig, train_mode_dictionary
from np_drake.lifting.training.network_training import NeuralConfig, train_neural
from np_drake.lifting.training.paper_training import PaperConfig, train_paper
from np_drake.training_data.segments import Segment, check_segments


@dc.dataclass(frozen=True)
class DmdcConfig:
    """Parameters of `dmdc` (last sample) and `delay-dmdc` (last ten, as in the tables of `np-drake
    evaluate`).
    """

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


Config = LiftedConfig | NeuralConfig | ModeDictionaryConfig | PaperConfig | DmdcConfig | RidgeConfig
DEFAULT_CONFIG = LiftedConfig()
CONFIGURATIONS: dict[str, Config] = {
    LIFTED: DEFAULT_CONFIG,
    PAPER: PaperConfig(),
    NEURAL: NeuralConfig(),
    MODE_DICTIONARY: ModeDictionaryConfig(),
    DMDC: DmdcConfig(),
    DELAY_DMDC: DmdcConfig(delays=10),
    RIDGE: RidgeConfig(),
}


@dc.dataclass(frozen=True)
class TrainingResult:
    """Result of one training run."""

    model: LiftedModel  # the trained predictor
    loss: list[float]  # after each epoch [1]


def train(
    segments: list[Segment], config: Config = DEFAULT_CONFIG, *, on_epoch: OnEpoch = lambda *_: None
) -> TrainingResult:
    """Train the configuration that `config` belongs to; deterministic by `config.seed`.

    Args:
        segments: uninterrupted flights at one step.
        config: of one of the `CONFIGURATIONS`.
        on_epoch: called with (epoch, total, loss); for `lifted` an epoch is one step of gradient
            descent.
    Raises: ValueError: if the segments are unusable.
    """
    run = _TRAINERS[type(config)]
    model, loss = run(segments, config, on_epoch)
    summary = {**model.summary, "settings": dc.asdict(config)}
    return TrainingResult(dc.replace(model, summary=summary), loss)


def suited(configuration: str, frame: str) -> str:
    """Return the configuration, or the one that suits the axes where none is named.

    Args:
        configuration: any name, or empty.
        frame: axes of the wrenches, world | body.
    Raises: ValueError: on an unknown frame.
    """
    if frame not in BY_AXES:
        raise ValueError(f"train: frame must be {' | '.join(BY_AXES)}; got {frame}.")
    return configuration or BY_AXES[frame]


def make_config(
    configuration: str, *, frame: str = "world", epochs: int | None = None, **settings
) -> Config:
    """Return the configuration of that name with the given settings.

    Args:
        configuration: a key of `CONFIGURATIONS`; empty for the one that suits the axes.
        frame: axes of the wrenches, world | body.
        epochs: of training, or steps; None: the default. One in closed form has none.
        settings: fields of the configuration.
    Raises: ValueError: on an unknown name, frame or setting.
    """
    configuration = suited(configuration, frame)
    if (configuration in FAMILIES and frame != "world") or (
        configuration == MODE_DICTIONARY and frame != "body"
    ):
        raise ValueError(
            f"train: wrenches in {frame} axes need {BY_AXES[frame]}; got {configuration}."
        )
    if configuration not in CONFIGURATIONS:
        raise ValueError(
            f"train: configuration must be {' | '.join(CONFIGURATIONS)}; got {configuration}."
        )
    config = CONFIGURATIONS[configuration]
    names = {field.name for field in dc.fields(config)}
    unknown = set(settings) - names
    if unknown:
        raise ValueError(f"train: {configuration} has no setting {', '.join(sorted(unknown))}.")
    if frame != "world" and "symmetric" in names:
        settings = {"symmetric": False} | settings
    if epochs is not None:
        settings |= dict.fromkeys(names & {"epochs", "steps", "updates"}, epochs)
    return dc.replace(config, **settings)


def _train_dmdc(
    segments: list[Segment], config: DmdcConfig, on_epoch: OnEpoch
) -> tuple[LiftedModel, list[float]]:
    """Return (model, [mean square of the scaled error one step ahead])."""
    segments = check_segments(segments, config.delays + 1)
    system, encoder = fit_dmdc_system(segments, config.delays)
    scale = sample_scale(segments)
    stable = system.stabilized()
    loss = _one_step_error(segments, stable, encoder, scale)
    on_epoch(1, 1, loss)
    summary = training_summary(segments, loss, segments[0].step) | {
        "spectral_radius_as_fitted": system.spectral_radius
    }
    name = DMDC if config.delays == 1 else DELAY_DMDC
    model = LiftedModel(name, stable, encoder, config.delays, scale[:6], scale[6:], True, summary)
    return model, [loss]


def _train_ridge(
    segments: list[Segment], config: RidgeConfig, on_epoch: OnEpoch
) -> tuple[LiftedModel, list[float]]:
    """Return (model, [mean square error over that of the better naive row])."""
    segments = check_segments(segments, config.delay + config.horizon + 1)
    scale, taps = sample_scale(segments), DelayTaps(config.delay, config.dense, config.averages)
    horizons, step = np.arange(config.horizon + 1), segments[0].step
    weights, constant, loss = window_ridge(
        segments, taps, horizons, noise=config.noise, origins=config.max_origins
    )
    on_epoch(1, 1, loss)
    E = weights[:, :3].reshape(3 * len(horizons), -1)
    encoder = DelayEncoder(E, config.delay, constant[:, :3].ravel())
    system = course_register(config.horizon, step)
    summary = training_summary(segments, loss, step)
    model = LiftedModel(RIDGE, system, encoder, config.delay, scale[:6], scale[6:], False, summary)
    return model, [loss]


def course_register(horizon: int, step: float) -> LiftedLinearSystem:
    """Return the system whose state is a whole forecast of the force, chi_hat_0 … chi_hat_H.

    A shifts it by one step and holds it at its end, and B = 0. Any forecast that does not depend on
    the coming motion is such a lifted linear system, exactly.

    Args:
        horizon: H [steps].
        step: [s].
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


_TRAINERS: dict[type, Callable[..., tuple[LiftedModel, list[float]]]] = {
    ModeDictionaryConfig: train_mode_dictionary,
    PaperConfig: train_paper,
    LiftedConfig: train_lifted,
    NeuralConfig: train_neural,
    DmdcConfig: _train_dmdc,
    RidgeConfig: _train_ridge,
}
