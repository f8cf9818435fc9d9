"""The models that ship with the package, made anew: a family of systems with its network, and a
payload filter.
"""

import dataclasses as dc
from pathlib import Path
from typing import NamedTuple

import numpy as np

from diagrams.batch.run import NoOptions as Options
from diagrams.batch.run import Report, Run
from diagrams.loop.controller_config import FILTER_MODEL, MODELS, NP_MODEL
from diagrams.prediction.envelope import train_on_envelope
from diagrams.prediction.learning import train_payload_filter_model
from diagrams.tracking.network_share import flown_share
from diagrams.tracking.tracking import DITHERED, training_flight
from np_drake.lifting.model.lifted_model import NEURAL
from np_drake.lifting.model.model_file import read_tensors, save_model, schema_of
from np_drake.lifting.training.train import make_config
from np_drake.vehicle import Vehicle

SEED, SOLVER = 0, "sqp"  # of the flights; the seed also of the training
FLIGHTS = 1000  # of the envelope


def make_packaged_models(run: Run, flights: int = FLIGHTS) -> list[Path]:
    """Fly and train, write both models into the folder of the run and return their files."""
    family, run = run.folder / NP_MODEL.name, dc.replace(run, seed=SEED)
    result = train_on_envelope(flights, make_config(NEURAL, seed=SEED), run=run, vehicle=Vehicle())
    save_model(flown_share(result.model, flights, run=run, vehicle=Vehicle()), family)
    return [family, make_filter(run.folder)]


def make_filter(folder: Path) -> Path:
    """Fly the training flight, train the payload filter on it and return its file in `folder`."""
    path = folder / FILTER_MODEL.name
    train_payload_filter_model(training_flight(DITHERED, seed=SEED, solver=SOLVER), path)
    return path


class Difference(NamedTuple):
    """Largest difference of two model files.

    relative: of a tensor, over its largest number [1].
    from_zero: of a tensor that is zero in the packaged file [SI].
    """

    relative: float
    from_zero: float


def difference(path: Path, packaged: Path | None = None) -> Difference:
    """Return the largest difference of a model file from the packaged one of its name, tensor by
    tensor.

    It is infinite where tensors or shapes differ.

    Args:
        packaged: that it is compared with; None: the packaged one of its name.
    Raises: ValueError: on a bad file.
    """
    packaged = packaged or MODELS / path.name
    if schema_of(path) != schema_of(packaged):
        return Difference(np.inf, np.inf)
    a, b = (read_tensors(file, schema_of(packaged))[0] for file in (path, packaged))
    if {name: value.shape for name, value in a.items()} != {
        name: value.shape for name, value in b.items()
    }:
        return Difference(np.inf, np.inf)
    return tensor_difference(a, b)


def tensor_difference(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> Difference:
    """Return the largest difference of tensors; NaN differs without bound.

    Args:
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
    """Make the packaged model files anew, and compare them with those in the package. --out DIR:
    the files.
    """
    files = make_packaged_models(run)
    lines = [
        {"file": file.name, "bytes": file.stat().st_size, **difference(file)._asdict()}
        for file in files
    ]
    rows: list[tuple] = [
        (line["file"], line["bytes"], f"{line['relative']:.2g}", f"{line['from_zero']:.2g}")
        for line in lines
    ]
    title = (
        f"largest differences from the packaged files; {FLIGHTS} flights of the envelope, "
        f"seed {SEED}, {SOLVER}"
    )
    return Report(
        [
            (
                title,
                ["file", "size [B]", "over the packaged one [1]", "where that is zero [SI]"],
                rows,
            )
        ],
        config={"seed": SEED, "solver": SOLVER, "flights": FLIGHTS},
        metrics={"models": lines},
    )
