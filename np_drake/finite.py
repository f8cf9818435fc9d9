"""Compiled check for NaN and infinity."""

from np_drake.compiled import compiled


@compiled
def finite(values):
    """Return whether all entries of a contiguous array of any shape are finite."""
    nothing = 0.0
    for value in values.ravel():
        nothing += 0.0 * value
    return nothing == 0.0
