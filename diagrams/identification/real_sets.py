"""Public sets of real flights of one vehicle each: where they lie, what their documents state, and two halves."""

import dataclasses as dc
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

from np_drake.flight_log import FlightLog
from np_drake.logs.formats.neurobem import AGILE, published_vehicle
from np_drake.logs.importing.log_map import load_map_file
from np_drake.logs.opening import read_as_logged, with_vehicle
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle_estimate import Measured, estimate

NEUROBEM = "neurobem"
BENCHMARK = "idsia"  # has a benchmark of open-loop prediction


@dc.dataclass(frozen=True)
class RealSet:
    """Set of flights.

    folder, pattern: of its logs.   vehicle: whose geometry is given.   mass: as its documents state it [kg]; None: not
    stated, so that all is told over it.   map: preset of `import`; empty: none is needed.
    """

    name: str
    folder: str
    pattern: str
    vehicle: Callable[[], Vehicle]
    mass: float | None
    map: str = ""


def _preset(name: str) -> Callable[[], Vehicle]:
    return lambda: load_vehicle(name)


def _indiflight() -> Vehicle:
    """Return a quadrotor of three-inch propellers; neither wheelbase nor mass is stated with the logs, a guess."""
    return estimate(Measured(0.2, 0.16, 0.076, 0.5, order="betaflight"), "estimate")


SETS = (
    RealSet("imrc", "imrc/bare", "*", _preset("crazyflie_brushless"), 0.037),
    RealSet(BENCHMARK, "idsia", "*.parquet", _preset("crazyflie_brushless"), 0.045, "idsia"),
    RealSet("nanobench", "nanobench", "dataset_*.csv.gz", _preset("crazyflie"), 0.027, "nanobench"),
    RealSet("indiflight", "indiflight", "LOG002*.BFL", _indiflight, None),
    RealSet(NEUROBEM, "csv", "merged_*.csv", published_vehicle, published_vehicle().mass),
)


@dc.dataclass(frozen=True)
class Folders:
    """Folders of the real flights; NeuroBEM has its own."""

    real: Path
    neurobem: Path | None = None

    def files(self, name: str) -> list[Path]:
        """Return the logs of a set, sorted by name; none where there is no such folder."""
        chosen = set_of(name)
        root = self.neurobem if name == NEUROBEM else self.real
        if root is None:
            return []
        found = sorted(
            path for path in (root / chosen.folder).glob(chosen.pattern) if path.is_file() and path.name[0] != "."
        )
        return [f for f in found if f.stem.removeprefix("merged_") in AGILE] if name == NEUROBEM else found


def set_of(name: str) -> RealSet:
    """Return the set of this name."""
    return next(s for s in SETS if s.name == name)


def present_sets(folders: Folders, only: Collection[str] = ()) -> list[str]:
    """Return the names of the sets of which two flights at least are there.

    Args:
        folders: of the flights.
        only: names; empty: all.
    Raises: ValueError: if a folder is missing, a name unknown, or no set is there.
    """
    names = [s.name for s in SETS]
    if unknown := sorted(set(only) - set(names)):
        raise ValueError(f"--only: must be of {', '.join(names)}; got {', '.join(unknown)}.")
    for folder in (folders.real, folders.neurobem):
        if folder is not None and not folder.is_dir():
            raise ValueError(f"{folder}: must be a folder of real flights; it is not there.")
    found = [name for name in names if (not only or name in only) and len(folders.files(name)) > 1]
    if not found:
        raise ValueError(f"{folders.real}: must hold two flights of {', '.join(only or names)}; got none.")
    return found


def halves(files: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Return every second file, beginning with the first, and the others."""
    return list(files[::2]), list(files[1::2])


def open_set(name: str, files: Sequence[Path]) -> list[FlightLog]:
    """Return the flights of logs of a set.

    Args:
        name: of the set.
        files: its logs.
    Raises: LogError: one line with file and reason; OSError: if one cannot be opened.
    """
    chosen = set_of(name)
    log_map = load_map_file(chosen.map) if chosen.map else None
    opened = with_vehicle([read_as_logged(path, log_map) for path in files], chosen.vehicle())
    return [log for found in opened for log in found.flights]
