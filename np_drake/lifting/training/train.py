"""Training of a predictor from plain arrays, with configurations by name."""

import dataclasses as dc
from collections.abc import Callable
from pathlib import Path

from np_drake.lifting.model.lifted_model import (
    DEFAULT,
    DELAY_DMDC,
    DICTIONARY,
    DMDC,
    PAPER,
    RIDGE,
    LiftedModel,
)
from np_drake.lifting.training.checkpoint import Checkpoint
from np_drake.lifting.training.default_training import DefaultConfig, train_default
from np_drake.lifting.training.dictionary_training import (
    FLIGHT_DICTIONARY,
    DictionaryConfig,
    train_dictionary,
)
from np_drake.lifting.training.linear_training import DmdcConfig, RidgeConfig, train_dmdc, train_ridge
from np_drake.lifting.training.paper_training import PaperConfig, train_paper
from np_drake.training_data.segments import Segment

Config = DefaultConfig | DictionaryConfig | PaperConfig | DmdcConfig | RidgeConfig
DEFAULT_CONFIG = DefaultConfig()
CONFIGURATIONS: dict[str, Config] = {
    DEFAULT: DEFAULT_CONFIG,
    PAPER: PaperConfig(),
    DICTIONARY: FLIGHT_DICTIONARY,
    DMDC: DmdcConfig(),
    DELAY_DMDC: DmdcConfig(delays=10),
    RIDGE: RidgeConfig(),
}
IN_BODY_AXES: dict[str, Config] = {  # where these differ for wrenches in body axes, at 400 Hz
    DEFAULT: DictionaryConfig(),
    DICTIONARY: DictionaryConfig(configuration=DICTIONARY),
}
TRAINERS: dict[type, Callable[..., tuple[LiftedModel, list[float]]]] = {
    DefaultConfig: train_default,
    DictionaryConfig: train_dictionary,
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
        on_epoch: called with (epoch, total, loss); for `default` an epoch is one L-BFGS iteration, and
            descents that converge early skip ahead.
    Raises: ValueError: if the segments are unusable or the checkpoint is of another run.
    """
    saved = Checkpoint(checkpoint, config, segments)
    run = TRAINERS[type(config)]
    model, loss = run(segments, config, saved, on_epoch)
    summary = {**model.summary, "settings": dc.asdict(config)}
    return TrainingResult(dc.replace(model, summary=summary), loss)


def make_config(configuration: str, *, frame: str = "world", epochs: int | None = None, **settings) -> Config:
    """Return the configuration of that name with the given settings.

    Args: frame: world | body; some configurations differ for wrenches in body axes.
    epochs: of training, or iterations; None: the default. One in closed form has none.
    Raises: ValueError: on an unknown name, frame or setting.
    """
    if frame not in ("world", "body"):
        raise ValueError(f"train: frame must be world | body; got {frame}.")
    if configuration not in CONFIGURATIONS:
        raise ValueError(f"train: configuration must be {' | '.join(CONFIGURATIONS)}; got {configuration}.")
    config = (IN_BODY_AXES if frame == "body" else {}).get(configuration, CONFIGURATIONS[configuration])
    names = {field.name for field in dc.fields(config)}
    unknown = set(settings) - names
    if unknown:
        raise ValueError(f"train: {configuration} has no setting {', '.join(sorted(unknown))}.")
    if epochs is not None:
        settings |= dict.fromkeys(names & {"epochs", "iterations"}, epochs)
    return dc.replace(config, **settings)
