"""Training of a predictor from plain arrays, with configurations by name."""

import dataclasses as dc
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from np_drake.checks import require
from np_drake.lifting.model.lifted_model import (
    BY_AXES,
    FAMILIES,
    LIFTED,
    MODE_DICTIONARY,
    NEURAL,
    PAPER,
    LiftedModel,
)
from np_drake.lifting.training import OnEpoch
from np_drake.lifting.training.family_training import LiftedConfig, train_lifted
from np_drake.lifting.training.mode_dictionary import ModeDictionaryConfig, train_mode_dictionary
from np_drake.lifting.training.network_training import NeuralConfig, train_neural
from np_drake.lifting.training.paper_training import PaperConfig, train_paper
from np_drake.training_data.segments import Segment

C = TypeVar("C")
Config = LiftedConfig | NeuralConfig | ModeDictionaryConfig | PaperConfig
DEFAULT_CONFIG = LiftedConfig()
CONFIGURATIONS: dict[str, Config] = {
    LIFTED: DEFAULT_CONFIG,
    PAPER: PaperConfig(),
    NEURAL: NeuralConfig(),
    MODE_DICTIONARY: ModeDictionaryConfig(),
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
    require(frame in BY_AXES, f"train: frame must be {' | '.join(BY_AXES)}; got {frame}.")
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
    require(
        (configuration not in FAMILIES or frame == "world")
        and (configuration != MODE_DICTIONARY or frame == "body"),
        f"train: wrenches in {frame} axes need {BY_AXES[frame]}; got {configuration}.",
    )
    names = {field.name for field in dc.fields(CONFIGURATIONS.get(configuration, DEFAULT_CONFIG))}
    if frame != "world" and "symmetric" in names:
        settings = {"symmetric": False} | settings
    if epochs is not None:
        settings |= dict.fromkeys(names & {"epochs", "steps", "updates"}, epochs)
    return configured(CONFIGURATIONS, configuration, settings)


def configured(configurations: Mapping[str, C], name: str, settings: Mapping[str, Any]) -> C:
    """Return the configuration of that name with the given settings.

    Raises: ValueError: on an unknown name or setting.
    """
    require(
        name in configurations,
        f"train: configuration must be {' | '.join(configurations)}; got {name}.",
    )
    config: Any = configurations[name]
    unknown = set(settings) - {field.name for field in dc.fields(config)}
    require(not unknown, f"train: {name} has no setting {', '.join(sorted(unknown))}.")
    return dc.replace(config, **settings)


_TRAINERS: dict[type, Callable[..., tuple[LiftedModel, list[float]]]] = {
    ModeDictionaryConfig: train_mode_dictionary,
    PaperConfig: train_paper,
    LiftedConfig: train_lifted,
    NeuralConfig: train_neural,
}
