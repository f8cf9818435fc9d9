"""What tests of several formats share: writers of made files, made streams, and all of a file."""

import importlib
from pathlib import Path
from types import ModuleType

import numpy as np

from np_drake.logs.formats.format import Format, Recording, Stream, by_stream, no_progress


def writer(name: str) -> ModuleType:
    """Return the module `<name>_writer.py` beside this file; its library is loaded here."""
    return importlib.import_module(f"tests.np_drake.logs.formats.{name}_writer")


def noise(columns, t: np.ndarray, seed: int = 0) -> Stream:
    """Return white noise of variance 1 at times t (n,) [s]."""
    rng = np.random.default_rng(seed)
    return Stream(t, {c: rng.standard_normal(len(t)) for c in columns})


def read(known: Format, path: Path, names: list[str] | None = None) -> Recording:
    """Return the named columns of a file; None: all of them."""
    contents = known.contents(path)
    everything = [f"{s}/{c}" for s, columns in contents.items() for c in columns]
    wanted = {s: [] for s in contents} if names is None else {}
    return known.read(
        path, wanted | by_stream(contents, everything if names is None else names), no_progress
    )
