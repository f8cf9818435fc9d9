"""Flights of the Neural-Fly data set (O'Connell et al. 2022): CSV at 50 Hz with lists in cells.

W is z up. The attitude `q` is x, y, z, w from body to W, the body's z axis along the thrust. The
rates `w` are in axes of W, not of the body: where the vehicle leans against the wind they differ,
and the derivative of `q` agrees in W only. `T_sp` is the normalised collective thrust command,
`hover_throttle` the one that hovers, by battery voltage; thrust grows with about the 1.3th power of
their quotient about hover. `pwm` [us] is that of the four motors.
"""

from pathlib import Path

from np_drake.logs.formats import table
from np_drake.logs.formats.format import Contents, Format
from np_drake.logs.formats.table_text import split_header
from np_drake.logs.importing.log_map import LogMap, Source

HEADER = (
    "t",
    "p",
    "v",
    "q",
    "R",
    "w",
    "T_sp",
    "q_sp",
    "hover_throttle",
    "fa",
    "pwm",
)  # of every such file


def _recognises(path: Path, start: bytes) -> bool:
    """Return whether the header has the columns of the data set."""
    return table.recognises(path, start) and set(HEADER) <= set(
        split_header(table.first_line(start))
    )


def _default_map(contents: Contents) -> LogMap | None:
    """Return the map of the data set; None if a column is not there.

    The rows are a thinned record of a faster loop: a command is a sample of one that changes in
    between.
    """
    log_map = LogMap(
        format="neural_fly",
        world="enu",
        body="flu",
        command="sampled",
        time=Source(["t"]),
        position=Source(_items("p", 3)),
        velocity=Source(_items("v", 3), axes="world"),
        attitude=Source(_items("q", 4), order="xyzw", direction="body_to_world"),
        rates=Source(_items("w", 3), axes="world"),
        throttle=Source(_items("T_sp", 1)),
        hover_throttle=Source(_items("hover_throttle", 1)),
    ).check()
    return log_map if set(log_map.names()) <= set(contents.get(table.STREAM, ())) else None


def _items(name: str, count: int) -> list[str]:
    return [f"{name}[{i}]" for i in range(count)]


TITLE = "Neural-Fly data set, CSV"
NEURAL_FLY = Format("neural_fly", TITLE, _recognises, table.contents, _default_map, table.read)
