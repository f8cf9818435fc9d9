"""Units that a log states for its columns, against those that its map declares."""

import numpy as np

from np_drake.logs.errors import LogError, place
from np_drake.logs.formats.format import Recording, find_column
from np_drake.logs.importing.log_map import UNITS, LogMap


def require_stated_units(recording: Recording, log_map: LogMap) -> None:
    """Check that the map's units are those that the file states, where it states one of that quantity.

    Args:
        recording: of the file.
        log_map: with the columns and their units.
    Raises: LogError: at the first column whose unit is another.
    """
    for name, source in log_map.sources():
        declared = source.unit or next(iter(UNITS[name]))
        for column in source.columns:
            _, own = find_column(recording.contents, column, recording.path)
            stated = recording.units.get(own, declared)
            # A scale may be that of the unit, or a gain in the unit that the file states.
            factors = np.multiply(UNITS[name][declared], [1.0, abs(source.scale)])
            if stated in UNITS[name] and not np.isclose(UNITS[name][stated], factors).any():
                raise LogError(
                    f"{place(recording.path, column=own)}: is in {stated} by the file, in {declared} by the map; "
                    f"write {name}: {{unit: {stated}}}, without a scale, in the map."
                )
