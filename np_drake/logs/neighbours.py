"""Logs of vehicles that flew nearby: whose neighbours they are, and their paths on the clock of the
flight beside.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from np_drake.flight_log import FlightLog, Neighbour
from np_drake.logs.errors import LogError

SHORTEST = (
    1.0  # time that two logs have in common, below which they are not of one run [s]; own choice
)
WHOLE = (
    0.99  # share of a flight that a neighbour covers, below which a note says so [1]; own choice
)
HOW = "Give the two logs of one run, with positions in one frame and times of one clock"


def neighbour_of(text: str, files: Sequence[Path]) -> tuple[Path, Path | None]:
    """Return the log of a neighbour and the log that it is beside, from LOG or LOG=OF; None: not
    stated.

    Args:
        files: logs that a neighbour may be beside, of which OF is a path or a file name.
    Raises: ValueError: if OF is none of them.
    """
    path, equals, name = text.rpartition("=")
    if not equals or Path(text).exists():
        return Path(text), None
    found = [file for file in files if file == Path(name)] or [
        file for file in files if file.name == name
    ]
    if not path or len(found) != 1:
        raise ValueError(
            f"--neighbour: OF of LOG=OF must be one of "
            f"{', '.join(file.name for file in files)}; got {name!r}."
        )
    return Path(path), found[0]


def whose(
    parts: Sequence[FlightLog], flights: Mapping[Path, Sequence[FlightLog]], path: Path
) -> Path:
    """Return the only file whose flights have time in common with the log of a neighbour.
    Raises: LogError: if there is none, or there are several, as where the clock of each log begins
        at zero.
    """
    common = [
        file
        for file, own in flights.items()
        if max(_common(log, part) for log in own for part in parts) > 0
    ]
    if len(common) == 1:
        return common[0]
    if not common:
        raise LogError(f"{path}: must have time in common with a flight; it has with none. {HOW}.")
    names = ", ".join(file.name for file in common)
    raise LogError(
        f"{path}: by their clocks it may be beside {names}; say beside which: --neighbour "
        f"{path}={common[0].name}."
    )


def with_neighbours(
    flights: Sequence[FlightLog], neighbours: Mapping[str, Sequence[FlightLog]], least: float
) -> list[FlightLog]:
    """Return flights with the paths of their neighbours, on the clock of each flight.

    Args:
        neighbours: by name of a flight, logs of vehicles that flew beside it.
        least: distance below which two vehicles would touch [m].
    Raises: LogError: one line with the remedy, if a name is of no flight, a log has no position or
        no time in common with its flight, or is of another frame or clock, so that the two would
        touch.
    """
    names = [log.name for log in flights]
    if unknown := [name for name in neighbours if name not in names]:
        raise LogError(
            f"neighbours: must be of {', '.join(names)}; got {unknown[0]!r}. Name a flight "
            f"that is given."
        )
    return [_beside(log, neighbours.get(log.name, ()), least) for log in flights]


def _beside(log: FlightLog, others: Sequence[FlightLog], least: float) -> FlightLog:
    for other in (log, *others) if others else ():
        if "height" in other.lacks:
            raise LogError(
                f"{other.name}: must tell the position beside a neighbour; it does not. {HOW}."
            )
    near = [other for other in others if _common(log, other) >= SHORTEST]
    if others and not near:
        spans = ", ".join(_span(other) for other in others)
        raise LogError(
            f"{others[0].name}: must have {SHORTEST:g} s in common with {log.name}, which "
            f"is of {_span(log)}; it is of "
            f"{spans}. {HOW}."
        )
    paths = [Neighbour(other.t + (other.start - log.start), other.p, other.name) for other in near]
    notes = [_checked(log, path, least) for path in paths]
    return dc.replace(log, neighbours=(*log.neighbours, *paths), notes=[*log.notes, *notes])


def _checked(log: FlightLog, path: Neighbour, least: float) -> str:
    """Return a note on what a neighbour covers of a flight, and how near it comes.

    Raises: LogError: if the two would touch.
    """
    away = path.at(log.t) - log.p
    known = np.isfinite(away[:, 0])
    distance = np.linalg.norm(away[known], axis=1)
    if not len(distance) or distance.min() < least:
        nearest = f"they are {distance.min():.2g} m apart" if len(distance) else "they share no row"
        raise LogError(
            f"{path.name}: must stay {least:.2g} m away from {log.name}; {nearest}. It is "
            f"the same vehicle, or of "
            f"another frame or clock. {HOW}."
        )
    above = away[known, 2] > 0
    share = "" if known.mean() > WHOLE else f" for {100 * known.mean():.0f} % of the flight"
    return (
        f"beside {path.name}{share}: nearest {distance.min():.2f} m, below it "
        f"{100 * above.mean():.0f} % of that time"
    )


def _common(log: FlightLog, other: FlightLog) -> float:
    """Return the time that two logs have in common on the clocks of their recordings [s]; negative:
    apart.
    """
    first, last = (
        max(log.t[0] + log.start, other.t[0] + other.start),
        min(*(_end(x) for x in (log, other))),
    )
    return float(last - first)


def _end(log: FlightLog) -> float:
    return float(log.t[-1] + log.start)


def _span(log: FlightLog) -> str:
    return f"{log.t[0] + log.start:.2f} to {_end(log):.2f} s"
