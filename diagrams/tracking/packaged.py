"""The models that ship with the package, made anew: one training flight, two configurations."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from diagrams.batch.run import NoOptions as Options
from diagrams.batch.run import Report, Run
from diagrams.loop.controllers import FILTER_MODEL, MODELS, NP_MODEL
from diagrams.prediction.learning import train_payload_filter_model, train_predictor
from diagrams.tracking.tracking import DITHERED, training_flight
from np_drake.lifting.model.model_file import read_tensors, schema_of

SEED, SOLVER = 0, "sqp"  # of the training flight; the seed also of the training


def make_packaged_models(
    folder: Path, *, on_step: Callable[[int, int, str], None] = lambda done, total, text: None
) -> list[Path]:
    """Fly the training flight, train both models on it, write them into `folder` and return their files.

    Args:
        folder: takes the files.
        on_step: called with (done, total, what comes).
    """
    files = [folder / packaged.name for packaged in (NP_MODEL, FILTER_MODEL)]
    on_step(0, 3, "training flight")
    flight = training_flight(DITHERED, seed=SEED, solver=SOLVER)
    on_step(1, 3, files[0].stem)
    train_predictor(flight, files[0], seed=SEED)
    on_step(2, 3, files[1].stem)
    train_payload_filter_model(flight, files[1])
    on_step(3, 3, "")
    return files


class Difference(NamedTuple):
    """Largest difference of two model files.

    relative: of a tensor, over its largest number [1].   from_zero: of a tensor that is zero in the packaged file [SI].
    """

    relative: float
    from_zero: float


def difference(path: Path, packaged: Path | None = None) -> Difference:
    """Return the largest difference of a model file from the packaged one of its name, tensor by tensor.

    It is infinite where tensors or shapes differ.

    Args:
        path: of the model file.
        packaged: that it is compared with; None: the packaged one of its name.
    Raises: ValueError: on a bad file.
    """
    packaged = packaged or MODELS / path.name
    if schema_of(path) != schema_of(packaged):
        return Difference(np.inf, np.inf)
    a, b = (read_tensors(file, schema_of(packaged))[0] for file in (path, packaged))
    if {name: value.shape for name, value in a.items()} != {name: value.shape for name, value in b.items()}:
        return Difference(np.inf, np.inf)
    return tensor_difference(a, b)


def tensor_difference(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> Difference:
    """Return the largest difference of tensors; NaN differs without bound.

    Args:
        a: tensors by name.
        b: those of the packaged file, of the same names and shapes.
    """
    relative, from_zero = [0.0], [0.0]
    for name, value in b.items():
        size = np.abs(value).max(initial=0.0)
        apart = np.nan_to_num(np.abs(a[name] - value), nan=np.inf).max(initial=0.0)
        if size > 0.0:
            relative.append(float(apart / size))
        else:
            from_zero.append(float(apart))
    return Difference(max(relative), max(from_zero))


def run(run: Run, options: Options) -> Report:
    """Make the packaged model files anew, and compare them with those in the package. --out DIR: the files.

    Args:
        run: seed, folders, workers and progress.
        options: of the study.
    """
    with run.progress("packaged models") as advance:
        files = make_packaged_models(run.folder, on_step=lambda done, total, text: advance(done / total, text))
    lines = [{"file": file.name, "bytes": file.stat().st_size, **difference(file)._asdict()} for file in files]
    rows: list[tuple] = [
        (line["file"], line["bytes"], f"{line['relative']:.2g}", f"{line['from_zero']:.2g}") for line in lines
    ]
    title = f"largest differences from the packaged files; training flight of the demo, seed {SEED}, {SOLVER}"
    return Report(
        [(title, ["file", "size [B]", "over the packaged one [1]", "where that is zero [SI]"], rows)],
        config={"seed": SEED, "solver": SOLVER},
        metrics={"models": lines},
    )
