"""Times of a stream from the column that a map names."""

import dataclasses as dc

import numpy as np

from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Recording, Stream, find_column
from np_drake.logs.importing.log_map import UNITS, LogMap


def with_map_time(recording: Recording, log_map: LogMap) -> Recording:
    """Return the recording with the times of one stream from the column that the map's `time` names [s].

    Other streams, and all where the map names none, keep the times of their format.
    Raises: LogError: if there is no such column, or a stream with rows has no time at all.
    """
    streams = dict(recording.streams)
    source = log_map.time
    if source:
        name, column = find_column(recording.contents, source.columns[0], recording.path)
        factor = source.scale * UNITS["time"][source.unit or "s"]
        stream = streams[name]
        t = np.asarray(stream.columns[column], float) * factor - source.late
        streams[name] = Stream(t, stream.columns)
    for name, stream in streams.items():
        if len(stream) and np.all(np.isnan(stream.t)):
            raise LogError(
                f"{recording.path}, stream {name}: must have a time column; name it as time in the map: "
                "time: {columns: [NAME], unit: s}."
            )
    return dc.replace(recording, streams=streams)
