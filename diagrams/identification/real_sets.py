"""Public sets of real flights of one vehicle each: campaigns in which nothing is attached, and two
halves of each.
"""

import dataclasses as dc
from collections.abc import Collection, Sequence
from pathlib import Path

from diagrams.challenge.real import Campaign, Truth, campaign_of, in_circle
from np_drake.flight_log import FlightLog
from np_drake.logs.importing.log_map import load_map_file
from np_drake.logs.opening import read_as_logged, with_vehicle
from np_drake.vehicle.estimate import Measured, estimate

BENCHMARK = "idsia"  # has a benchmark of open-loop prediction
# A quadrotor of three-inch propellers; neither wheelbase nor mass is stated with the logs: a guess,
# and all is told over the mass. What acts on these flights is not known either, so that they give
# no case of the diagnosis.
INDIFLIGHT = Campaign(
    "indiflight",
    "indiflight",
    ("indiflight/LOG002*.BFL",),
    estimate(Measured(0.2, 0.16, 0.076, 0.5, order="betaflight"), "estimate"),
    Truth("Indiflight: what acts is not known.", ()),
    in_circle,
)
SETS = {
    "imrc": campaign_of("bare"),
    BENCHMARK: campaign_of("idsia"),
    "nanobench": campaign_of("nanobench"),
    "indiflight": INDIFLIGHT,
    "neurobem": campaign_of("neurobem"),
}


def stated_mass(name: str) -> float | None:
    """Return the mass that the documents of a set state [kg]; None: they do not, so that all is
    told over it.
    """
    return None if SETS[name] is INDIFLIGHT else SETS[name].nominal.mass


@dc.dataclass(frozen=True)
class Folders:
    """Folders of the real flights; NeuroBEM has its own."""

    real: Path
    neurobem: Path | None = None

    def files(self, name: str) -> list[Path]:
        """Return the logs of a set, sorted by name; none where there is no such folder."""
        return SETS[name].files(self.real, self.neurobem)


def present_sets(folders: Folders, only: Collection[str] = ()) -> list[str]:
    """Return the names of the sets of which two flights at least are there.
    Raises: ValueError: if a folder is missing, a name unknown, or no set is there.
    """
    names = list(SETS)
    if unknown := sorted(set(only) - set(names)):
        raise ValueError(f"--only: must be of {', '.join(names)}; got {', '.join(unknown)}.")
    for folder in (folders.real, folders.neurobem):
        if folder is not None and not folder.is_dir():
            raise ValueError(f"{folder}: must be a folder of real flights; it is not there.")
    found = [name for name in names if (not only or name in only) and len(folders.files(name)) > 1]
    if not found:
        raise ValueError(
            f"{folders.real}: must hold two flights of {', '.join(only or names)}; got none."
        )
    return found


def halves(files: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Return every second file, beginning with the first, and the others."""
    return list(files[::2]), list(files[1::2])


def open_set(name: str, files: Sequence[Path]) -> list[FlightLog]:
    """Return the flights of logs of a set.
    Raises: LogError: one line with file and reason; OSError: if one cannot be opened.
    """
    chosen = SETS[name]
    log_map = load_map_file(chosen.map) if chosen.map else None
    opened = with_vehicle([read_as_logged(path, log_map) for path in files], chosen.nominal)
    return [log for found in opened for log in found.flights]
