"""Checkpoints of a training run: safetensors, tied to one configuration, one data set and one version.

Order of batches and starts are drawn from (seed, epoch) and (seed, start), never from a generator that lives on, so
that no generator's state belongs to a checkpoint: a resumed run is the uninterrupted one, bit for bit on one machine.
"""

import dataclasses as dc
import hashlib
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.lifting.model.model_file import read_tensors, write_tensors
from np_drake.training_data.segments import Segment

OnEpoch = Callable[[int, int, float], None]  # called with (epoch, total, loss)
SCHEMA = "np_drake.training/1"  # format of the file and its version
REMEDY = "Remove it to train from the start, or name another --checkpoint."


class Checkpoint:
    """File with the tensors of an unfinished run.

    Args:
        path: of the file; None: nothing is stored.
        config: of the run.
        segments: that it trains on.
    """

    def __init__(self, path: str | Path | None, config: Any, segments: list[Segment]):
        self._path = None if path is None else Path(path)
        self._fingerprint = fingerprint(config, segments)

    def load(self) -> dict[str, np.ndarray]:
        """Return the saved tensors; an empty dict where nothing was saved.

        Raises: ValueError: one line, if the file is broken or pickled, or belongs to another configuration, other data
            or another version. What passes has the names and shapes that this run saves.
        """
        if self._path is None or not self._path.exists():
            return {}
        try:
            tensors, metadata = read_tensors(self._path, SCHEMA, what="checkpoint")
        except ValueError as error:
            raise ValueError(f"{error} {REMEDY}") from error
        if metadata.get("fingerprint") != self._fingerprint:
            raise ValueError(
                f"{self._path}: checkpoint must be of this configuration and data, and of np_drake "
                f"{version('np_drake')}; it is not. {REMEDY}"
            )
        if metadata.get("digest") != digest_of(tensors):
            raise ValueError(f"{self._path}: checkpoint must be whole; it is damaged. {REMEDY}")
        return tensors

    def save(self, tensors: dict[str, np.ndarray]) -> None:
        """Replace the file, whole or not at all."""
        if self._path is not None:
            metadata = {"schema": SCHEMA, "fingerprint": self._fingerprint, "digest": digest_of(tensors)}
            write_tensors(tensors, metadata, self._path)


def digest_of(tensors: dict[str, np.ndarray]) -> str:
    """Return a hash of names, shapes and numbers of tensors."""
    digest = hashlib.sha256()
    for name in sorted(tensors):
        value = np.ascontiguousarray(tensors[name])
        digest.update(f"{name} {value.shape} {value.dtype}".encode())
        digest.update(value.tobytes())
    return digest.hexdigest()


def fingerprint(config: Any, segments: list[Segment]) -> str:
    """Return a hash of the version, the configuration and every number of the data.

    Args:
        config: a dataclass.
        segments: that are trained on.
    """
    head = f"{version('np_drake')} {type(config).__name__} {dc.asdict(config)}"
    digest = hashlib.sha256(head.encode())
    for segment in segments:
        for array in (segment.chi, segment.zeta, segment.goal, np.array([segment.step, segment.late])):
            digest.update(np.ascontiguousarray(array, float).tobytes())
    return digest.hexdigest()
