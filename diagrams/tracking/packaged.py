"""The models that ship with the package, made anew: one training flight, two configurations."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from diagrams.loop.controllers import DEFAULT_MODEL, FLYING_MODEL, MODELS
from diagrams.prediction.learning import train_pendulum_model, train_predictor
from diagrams.tracking.tracking import DITHERED, training_flight
from np_drake.lifting.model.model_file import read_tensors, schema_of

SEED, SOLVER = 0, "sqp"  # of the training flight; the seed also of the training


def make_packaged_models(
    folder: Path, *, on_step: Callable[[int, int, str], None] = lambda done, total, text: None
) -> list[Path]:
    """Fly the training flight, train both models on it, write them into `folder` and return their files.

    Args: on_step: called with (done, total, what comes).
    """
    files = [folder / packaged.name for packaged in (DEFAULT_MODEL, FLYING_MODEL)]
    on_step(0, 3, "training flight")
    flight = training_flight(DITHERED, seed=SEED, solver=SOLVER)
    on_step(1, 3, files[0].stem)
    train_predictor(flight, files[0], seed=SEED)
    on_step(2, 3, files[1].stem)
    train_pendulum_model(flight, files[1])
    on_step(3, 3, "")
    return files


def difference(path: Path, packaged: Path | None = None) -> float:
    """Return the largest difference of a model file from the packaged one of its name, tensor by tensor [1].

    It is over the largest number of the tensor, and infinite where tensors or shapes differ.
    Raises: ValueError: on a bad file.
    """
    packaged = packaged or MODELS / path.name
    if schema_of(path) != schema_of(packaged):
        return np.inf
    a, b = (read_tensors(file, schema_of(packaged))[0] for file in (path, packaged))
    if {name: value.shape for name, value in a.items()} != {name: value.shape for name, value in b.items()}:
        return np.inf
    return max(float(np.abs(a[name] - b[name]).max() / max(np.abs(b[name]).max(), 1e-300)) for name in a)
