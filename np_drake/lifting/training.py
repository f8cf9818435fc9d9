"""Algorithm 1: training of a predictor from plain arrays, configurations by name."""

import dataclasses as dc
from collections.abc import Callable

from np_drake.lifting.default_training import DefaultConfig, train_default
from np_drake.lifting.lifted_model import LiftedModel
from np_drake.lifting.segments import Segment

Config = DefaultConfig


@dc.dataclass(frozen=True)
class TrainingResult:
    """model: what flies.   loss: after each epoch [1]."""

    model: LiftedModel
    loss: list[float]


def train(
    segments: list[Segment],
    config: Config = DefaultConfig(),
    *,
    on_epoch: Callable[[int, int, float], None] = lambda *_: None,
) -> TrainingResult:
    """Trains the configuration that `config` belongs to; deterministic by `config.seed`."""
    model, loss, _ = train_default(segments, config, on_epoch=on_epoch)
    return TrainingResult(model, loss)
