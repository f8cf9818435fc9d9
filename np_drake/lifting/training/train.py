"""Training of a predictor from plain arrays, with configurations by name."""

import dataclasses as dc
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from np_drake.checks import require
from np_drake.lifting.model.lifted_model import MODE_DICTIONARY, PAPER, LiftedModel
from np_drake.lifting.model.lpv_model import NEURAL_LPV, LpvModel
from np_drake.lifting.training import OnEpoch
from np_drake.lifting.training.mode_dictionary import ModeDictionaryConfig, train_mode_dictionary
from np_drake.lifting.training.neural_lpv import NeuralLpvConfig, train_neural_lpv
from np_drake.lifting.training.paper_training import PaperConfig, train_paper
from np_drake.training_data.segments import Segment

C = TypeVar("C")
Config = ModeDictionaryConfig | NeuralLpvConfig | PaperConfig
CONFIGURATIONS: dict[str, Config] = {
    PAPER: PaperConfig(),
    NEURAL_LPV: NeuralLpvConfig(),
    MODE_DICTIONARY: ModeDictionaryConfig(),
}
AXES = {NEURAL_LPV: "world", MODE_DICTIONARY: "body"}  # that a configuration needs
IN_BODY_AXES: dict[str, Any] = {"symmetric": False, "lags": (0,)}  # settings of `paper`


@dc.dataclass(frozen=True)
class TrainingResult:
    """Result of one training run."""

    model: LiftedModel | LpvModel  # the trained predictor
    loss: list[float]  # after each epoch [1]


def train(
    segments: list[Segment], config: Config, *, on_epoch: OnEpoch = lambda *_: None
) -> TrainingResult:
    """Train the configuration that `config` belongs to; deterministic by `config.seed`.

    Args:
        segments: uninterrupted flights at one step.
        config: of one of the `CONFIGURATIONS`.
        on_epoch: called with (epoch, total, loss).
    Raises: ValueError: if the segments are unusable.
    """
    run = _TRAINERS[type(config)]
    model, loss = run(segments, config, on_epoch)
    summary = {**model.summary, "settings": dc.asdict(config)}
    return TrainingResult(dc.replace(model, summary=summary), loss)


def make_config(
    configuration: str, *, frame: str = "world", epochs: int | None = None, **settings
) -> Config:
    """Return the configuration of that name with the given settings.

    Args:
        configuration: a key of `CONFIGURATIONS`.
        frame: axes of the wrenches, world | body.
        epochs: of training; None: the default. A configuration in closed form has none.
        settings: fields of the configuration.
    Raises: ValueError: on an unknown name or setting, or where wrenches in these axes need another.
    """
    needed = AXES.get(configuration, frame)
    require(
        frame == needed,
        f"train: {configuration} needs wrenches in {needed} axes; these are in {frame} axes.",
    )
    if configuration == PAPER and frame == "body":
        settings = IN_BODY_AXES | settings
    if epochs is not None and hasattr(CONFIGURATIONS.get(configuration), "epochs"):
        settings["epochs"] = epochs
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


_TRAINERS: dict[type, Callable[..., tuple[Any, list[float]]]] = {
    ModeDictionaryConfig: train_mode_dictionary,
    NeuralLpvConfig: train_neural_lpv,
    PaperConfig: train_paper,
}
