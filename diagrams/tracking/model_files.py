"""Model files that flights need, trained as cases of a campaign; they travel by their content."""

import base64
import dataclasses as dc
import hashlib
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from diagrams.batch.campaign import Case, Record
from diagrams.batch.run import Run
from diagrams.loop.controller_config import NP_MODEL
from diagrams.tracking.tracking import DITHERED, Row, train_models
from np_drake.files.atomic_file import atomic_path
from np_drake.lifting.model.lifted_model import FAMILIES
from np_drake.vehicle import Vehicle

Key = tuple[str, str]  # training experiment and configuration
Models = dict[Key, bytes]  # content of the model files


def key_of(row: Row) -> Key:
    """Return what the row's model is known by."""
    return row.training, row.configuration


def model_of(training: Record) -> bytes:
    """Return the content of the model file of a training's record."""
    return base64.b64decode(training["result"]["file"])


@cache  # a case of thousands asks for it
def digest_of(content: bytes | None) -> str:
    """Return the digest of a model file, by which a case names it; empty without one."""
    return "" if content is None else hashlib.sha256(content).hexdigest()[:16]


@contextmanager
def model_path(content: bytes | None) -> Iterator[str]:
    """Yield the path of a file with the content, for as long as the context lasts; empty without
    content.
    """
    if content is None:
        yield ""
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.safetensors"
        path.write_bytes(content)
        yield str(path)


def training_case(configuration: str, **more: str) -> Case:
    """Return the case of a training; one that places the packaged family names its file by its
    digest.
    """
    prior = {"prior": digest_of(NP_MODEL.read_bytes())} if configuration in FAMILIES else {}
    return {"model": configuration, **more, **prior}


def file_name(key: Key) -> str:
    """Return the name that a model file has in a folder of models."""
    training, configuration = key
    return f"{configuration}_{training}.safetensors"


@dc.dataclass(frozen=True)
class Training:
    """Work of a training case: {"model": configuration, "training": experiment} -> {"file": model
    file in base 64}.

    A case may leave out the experiment, `DITHERED`, and may name a vehicle.
    reality: scenario file of the training flight.
    vehicles: those that cases name.
    """

    seed: int
    solver: str
    reality: Path | None = None
    vehicles: Mapping[str, Vehicle] = dc.field(default_factory=dict)

    def __call__(self, case: Case) -> dict:
        """Fly the training flight and train the model of the case."""
        row = Row("", "np", training=case.get("training", DITHERED), configuration=case["model"])
        vehicle = self.vehicles.get(case.get("vehicle", ""))
        with tempfile.TemporaryDirectory() as folder:
            files = train_models(
                (row,),
                Path(folder),
                seed=self.seed,
                solver=self.solver,
                vehicle=vehicle,
                reality=self.reality,
            )
            return {"file": base64.b64encode(Path(*files.values()).read_bytes()).decode()}


def trained_models(
    run: Run, rows: Sequence[Row], training: Callable[[Case], dict], config: dict
) -> Models:
    """Train what `rows` need, write the model files into the folder of the run and return their
    content.

    A model whose training failed is missing.

    Args:
        training: the work, a `Training`.
        config: as of `run_campaign`.
    """
    keys = list(dict.fromkeys(key_of(row) for row in rows if row.training))
    cases = [
        training_case(configuration, training=experiment) for experiment, configuration in keys
    ]
    records = run.cases("training", "models", training, cases, config=config)
    models = {
        key: model_of(record)
        for key, record in zip(keys, records, strict=True)
        if "result" in record
    }
    for key, content in models.items():
        with atomic_path(run.folder / file_name(key)) as path:
            path.write_bytes(content)
    return models


def rows_with_models(rows: Sequence[Row], models: Models) -> list:
    """Return the rows that can fly: those without training, and those whose model is there."""
    return [row for row in rows if not row.training or key_of(row) in models]
