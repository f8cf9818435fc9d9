"""Case folder: one vehicle, the flights to fit and the held-out flights
(docs/reference/files.md).
"""

import dataclasses as dc
from collections.abc import Sequence
from pathlib import Path

from np_drake.flight_log import FlightLog
from np_drake.logs.formats.log_file import SUFFIXES
from np_drake.logs.neighbours import neighbour_of, whose
from np_drake.logs.opening import Opened, read_as_logged, with_vehicle
from np_drake.vehicle import Vehicle, load_vehicle

SHORTEST = 3.0  # part of a flight that can be diagnosed [s]
VEHICLE, TRAIN, HELD_OUT = (
    "vehicle.yaml",
    "train_",
    "heldout",
)  # file name, and starts of file names


@dc.dataclass(frozen=True)
class CaseFiles:
    """Paths of the files of a case.

    vehicle: None without a vehicle file.
    train: flights to fit.
    held_out: flights for evaluation.
    """

    vehicle: Path | None
    train: tuple[Path, ...]
    held_out: tuple[Path, ...]

    def open(
        self, vehicle: Vehicle, *, repair: bool = False
    ) -> tuple[list[FlightLog], list[FlightLog]]:
        """Return the flights to fit and the held-out flights, in their parts between long gaps.

        Args:
            vehicle: gives thrust and torque from rotor speed or throttle.
            repair: mend a few bad rows instead of refusing them.
        Raises: LogError, OSError: one line, at the first file that is not usable.
        """
        opened = with_vehicle(
            [read_as_logged(path, repair=repair) for path in (*self.train, *self.held_out)], vehicle
        )
        parts = [_parts(found) for found in opened]
        train, held_out = parts[: len(self.train)], parts[len(self.train) :]
        return [log for own in train for log in own], [log for own in held_out for log in own]

    def open_neighbours(
        self, given: Sequence[str], logs: Sequence[Sequence[FlightLog]]
    ) -> dict[str, list[FlightLog]]:
        """Return the logs of vehicles that flew beside, by name of the flight of `logs`.

        Args:
            given: LOG=OF, OF a file of the case, or LOG.
            logs: as `open` returned them.
        Raises: LogError, ValueError, OSError: one line, if one is not usable, or whose neighbour it
            is stays open.
        """
        files = (*self.train, *self.held_out)
        own = {file: [log for some in logs for log in some if _is_of(log, file)] for file in files}
        found: dict[str, list[FlightLog]] = {}
        for text in given:
            path, of = neighbour_of(text, files)
            parts = _parts(read_as_logged(path))
            for log in own[of or whose(parts, own, path)]:
                found.setdefault(log.name, []).extend(parts)
        return found


def find_case(folder: str | Path, vehicle: Path | None = None) -> CaseFiles:
    """Return the files of a case folder, sorted by name; nothing is opened.

    Args:
        folder: of the case.
        vehicle: in the place of the folder's.
    Raises: ValueError: if it is no folder, or the vehicle or a flight of either kind is missing.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(
            f"{folder}: must be a case folder; it is "
            f"{'a file' if folder.exists() else 'not there'}."
        )
    if vehicle is None and not (folder / VEHICLE).is_file():
        raise ValueError(
            f"{folder}: a case folder must hold {VEHICLE}, or a vehicle must be named."
        )
    flights = sorted(
        path for path in folder.iterdir() if path.name.endswith(SUFFIXES) and path.is_file()
    )
    train, held_out = (
        tuple(path for path in flights if path.name.startswith(start))
        for start in (TRAIN, HELD_OUT)
    )
    for start, found in ((TRAIN, train), (HELD_OUT, held_out)):
        if not found:
            raise ValueError(
                f"{folder}: a case folder must hold {start}*{{{', '.join(SUFFIXES)}}}; got none."
            )
    return CaseFiles(vehicle or folder / VEHICLE, train, held_out)


def open_case(folder: str | Path) -> tuple[Vehicle, list[FlightLog], list[FlightLog]]:
    """Return the vehicle of a case folder, its flights to fit and its held-out flights.

    Raises: ValueError, LogError, OSError: one line, if the folder is no case, or a file of it is
    not usable.
    """
    files = find_case(folder)
    vehicle = load_vehicle(str(files.vehicle))
    return vehicle, *files.open(vehicle)


def _parts(found: Opened) -> list[FlightLog]:
    """Return a flight to diagnose, named as its file, in its parts between long gaps.

    Parts shorter than `SHORTEST` are left out, unless all are, and the notes say so.
    """
    parts, path = found.flights, found.path
    if len(parts) == 1:
        return [dc.replace(parts[0], name=path.name)]
    kept = [log for log in parts if log.t[-1] - log.t[0] >= SHORTEST] or parts
    note = [f"{len(parts) - len(kept)} parts shorter than {SHORTEST:g} s left out"] * (
        len(kept) < len(parts)
    )
    return [
        dc.replace(
            log,
            name=f"{path.name} part {i}",
            notes=[*log.notes, *note] if i == 1 else _own(log, kept[0]),
        )
        for i, log in enumerate(kept, start=1)
    ]


def _is_of(log: FlightLog, file: Path) -> bool:
    """Return whether a flight is of a file, by the name that `_parts` gave it."""
    return log.name == file.name or log.name.startswith(f"{file.name} part ")


def _own(log: FlightLog, first: FlightLog) -> list[str]:
    """Return the notes of a part that are not those of the whole file."""
    return [note for note in log.notes if note not in first.notes]
