"""Training of a predictor from plain arrays, with configurations by name."""

import dataclasses as dc
import logging
from collections.abc import Callable
from pathlib import Path

from np_drake.lifting.model.lifted_model import (
    BY_AXES,
    DELAY_DMDC,
    DELAY_MODAL,
    DMDC,
    MODE_DICTIONARY,
    OLD_NAMES,
    PAPER,
    RIDGE,
    LiftedModel,
)
from np_drake.lifting.training.checkpoint import Checkpoint
from np_drake.lifting.training.delay_modal_training import DelayModalConfig, train_delay_modal
from np_drake.lifting.training.linear_training import DmdcConfig, RidgeConfig, train_dmdc, train_ridge
from np_drake.lifting.training.mode_dictionary_training import ModeDictionaryConfig, train_mode_dictionary
from np_drake.lifting.training.paper_training import PaperConfig, train_paper
from np_drake.training_data.segments import Segment

_log = logging.getLogger(__name__)
Config = DelayModalConfig | ModeDictionaryConfig | PaperConfig | DmdcConfig | RidgeConfig
DEFAULT_CONFIG = DelayModalConfig()
CONFIGURATIONS: dict[str, Config] = {
    DELAY_MODAL: DEFAULT_CONFIG,
    PAPER: PaperConfig(),
    MODE_DICTIONARY: ModeDictionaryConfig(),
    DMDC: DmdcConfig(),
    DELAY_DMDC: DmdcConfig(delays=10),
    RIDGE: RidgeConfig(),
}
TRAINERS: dict[type, Callable[..., tuple[LiftedModel, list[float]]]] = {
    DelayModalConfig: train_delay_modal,
    ModeDictionaryConfig: train_mode_dictionary,
    PaperConfig: train_paper,
    DmdcConfig: train_dmdc,
    RidgeConfig: train_ridge,
}


@dc.dataclass(frozen=True)
class TrainingResult:
    """Result of one training run.

    model: the trained predictor.   loss: after each epoch [1].
    """

    model: LiftedModel
    loss: list[float]


def train(
    segments: list[Segment],
    config: Config = DEFAULT_CONFIG,
    *,
    checkpoint: str | Path | None = None,
    on_epoch: Callable[[int, int, float], None] = lambda *_: None,
) -> TrainingResult:
    """Train the configuration that `config` belongs to; deterministic by `config.seed`.

    Args:
        segments: uninterrupted flights at one step.
        checkpoint: file that the run is saved to as it goes, and resumed from where it exists (same
            configuration and data); the result is that of an uninterrupted run. Configurations in closed form, done in
            seconds, leave it alone.
        on_epoch: called with (epoch, total, loss); for `delay-modal` an epoch is one L-BFGS iteration, and
            descents that converge early skip ahead.
    Raises: ValueError: if the segments are unusable or the checkpoint is of another run.
    """
    saved = Checkpoint(checkpoint, config, segments)
    run = TRAINERS[type(config)]
    model, loss = run(segments, config, saved, on_epoch)
    summary = {**model.summary, "settings": dc.asdict(config)}
    return TrainingResult(dc.replace(model, summary=summary), loss)


def present_name(configuration: str, frame: str = "world") -> str:
    """Return the present name of a configuration, and warn where an old one was given.

    Args:
        configuration: any name; empty for the one that suits the axes.
        frame: axes of the wrenches, world | body.
    Raises: ValueError: on an unknown frame.
    """
    if frame not in BY_AXES:
        raise ValueError(f"train: frame must be {' | '.join(BY_AXES)}; got {frame}.")
    if not configuration:
        return BY_AXES[frame]
    if configuration in OLD_NAMES:
        _log.warning("configuration %s is now called %s.", configuration, BY_AXES[frame])
        return BY_AXES[frame]
    return configuration


def make_config(configuration: str, *, frame: str = "world", epochs: int | None = None, **settings) -> Config:
    """Return the configuration of that name with the given settings.

    Args:
        configuration: a key of `CONFIGURATIONS`, or an old name.
        frame: axes of the wrenches, world | body.
        epochs: of training, or iterations; None: the default. One in closed form has none.
        settings: fields of the configuration.
    Raises: ValueError: on an unknown name, frame or setting.
    """
    configuration = present_name(configuration, frame)
    if configuration != BY_AXES[frame] and configuration in BY_AXES.values():
        raise ValueError(f"train: wrenches in {frame} axes need {BY_AXES[frame]}; got {configuration}.")
    if configuration not in CONFIGURATIONS:
        raise ValueError(f"train: configuration must be {' | '.join(CONFIGURATIONS)}; got {configuration}.")
    config = CONFIGURATIONS[configuration]
    names = {field.name for field in dc.fields(config)}
    unknown = set(settings) - names
    if unknown:
        raise ValueError(f"train: {configuration} has no setting {', '.join(sorted(unknown))}.")
    if epochs is not None:
        settings |= dict.fromkeys(names & {"epochs", "iterations"}, epochs)
    return dc.replace(config, **settings)
