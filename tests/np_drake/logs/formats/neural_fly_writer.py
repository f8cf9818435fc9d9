"""Writer of made files of the Neural-Fly data set: lists in cells, rows numbered in a column
without a name.
"""

import gzip
import json
from pathlib import Path

import numpy as np

from np_drake.logs.formats.format import Stream

SHAPES = {  # columns of the file: shape of a cell
    "p": (3,),
    "p_d": (3,),
    "v": (3,),
    "v_d": (3,),
    "q": (4,),
    "R": (3, 3),
    "w": (3,),
    "T_sp": (1,),
    "q_sp": (4,),
    "hover_throttle": (1,),
    "fa": (3,),
    "pwm": (4,),
}


def write(path: Path, streams: dict[str, Stream]) -> None:
    """Write the one stream, with columns `p[0]`, …; those that it lacks are zero."""
    (stream,) = streams.values()
    lines = [",".join(["", "t", *SHAPES])]
    for row, t in enumerate(stream.t):
        cells = [repr(float(t)), *(f'"{_list(stream, name, row)}"' for name in SHAPES)]
        lines.append(",".join([str(row), *cells]))
    content = "\n".join([*lines, ""]).encode()
    path.write_bytes(gzip.compress(content, mtime=0) if path.suffix == ".gz" else content)


def _list(stream: Stream, name: str, row: int) -> str:
    size = int(np.prod(SHAPES[name]))
    columns = [stream.columns.get(f"{name}[{i}]") for i in range(size)]
    numbers = [0.0 if column is None else float(column[row]) for column in columns]
    return json.dumps(np.reshape(numbers, SHAPES[name]).tolist())
