"""NumPy arrays on file (.npy), never pickled, and never larger than their file."""

import tokenize
import warnings
from pathlib import Path

import numpy as np

from np_drake.files.input_guard import note_input
from np_drake.logs.errors import LogError

# What NumPy's reader raises on a damaged header, which is Python text, or on one that announces too much.
DAMAGED = (ValueError, EOFError, OverflowError, TypeError, SyntaxError, RecursionError, tokenize.TokenError)


def read_array(path: str | Path) -> np.ndarray:
    """Return the array in a file; it is mapped first, so that a header takes no memory that the file does not hold.

    Raises: LogError: if the file is no whole plain array; OSError: if it cannot be opened.
    """
    with Path(path).open("rb") as file:
        start = file.read(2)
    if start == b"PK":
        raise LogError(
            f"{path}: must be one array (.npy); it is an archive (.npz). Save the array by itself."
        )
    note_input(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of a header as Python 2 wrote it
            return np.array(np.load(path, mmap_mode="r", allow_pickle=False))
    except DAMAGED as error:
        raise LogError(
            f"{path}: must be a plain NumPy array (.npy); cut off or pickled files are refused."
        ) from error
