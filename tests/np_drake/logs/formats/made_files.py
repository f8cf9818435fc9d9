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


def assert_holds(recording: Recording, streams: dict[str, Stream]) -> None:
    """Check that all numbers were read; times are rounded to nanoseconds."""
    assert set(recording.streams) == set(streams)
    for name, made in streams.items():
        np.testing.assert_allclose(recording.streams[name].t, made.t, rtol=0, atol=1e-9)
        for column, values in made.columns.items():
            np.testing.assert_array_equal(recording.streams[name].columns[column], values)


def read(known: Format, path: Path, names: list[str] | None = None) -> Recording:
    """Return the named columns of a file; None: all of them."""
    contents = known.contents(path)
    everything = [f"{s}/{c}" for s, columns in contents.items() for c in columns]
    wanted = {s: [] for s in contents} if names is None else {}
    return known.read(
        path, wanted | by_stream(contents, everything if names is None else names), no_progress
    )
