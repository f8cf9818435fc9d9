"""Checkpoints of a training run: safetensors, tied to one configuration and one data set."""

import dataclasses as dc
import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.lifting.model.model_file import read_tensors, write_tensors
from np_drake.lifting.training.segments import Segment

SCHEMA = "np_drake.training/1"  # format of the file and its version


class Checkpoint:
    """File with the tensors of an unfinished run; nothing is stored where `path` is None."""

    def __init__(self, path: str | Path | None, config: Any, segments: list[Segment]):
        self._path = None if path is None else Path(path)
        self._fingerprint = fingerprint(config, segments)

    def load(self) -> dict[str, np.ndarray]:
        """Return the saved tensors; an empty dict where nothing was saved.

        Raises: ValueError: if the file is broken or belongs to another configuration or other data. What passes has the
        names and shapes that this run saves.
        """
        if self._path is None or not self._path.exists():
            return {}
        tensors, metadata = read_tensors(self._path, SCHEMA)
        if metadata.get("fingerprint") != self._fingerprint:
            raise ValueError(
                f"{self._path}: checkpoint must be of this configuration and data; it is not. Remove it."
            )
        if metadata.get("digest") != digest_of(tensors):
            raise ValueError(f"{self._path}: checkpoint must be whole; it is damaged. Remove it.")
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
    """Return a hash of the configuration and of every number of the data."""
    digest = hashlib.sha256(f"{type(config).__name__} {dc.asdict(config)}".encode())
    for segment in segments:
        for array in (segment.chi, segment.zeta, segment.goal, np.array([segment.step])):
            digest.update(np.ascontiguousarray(array, float).tobytes())
    return digest.hexdigest()
