"""Cases of the real flights, of all campaigns that lie in a folder."""

import dataclasses as dc
from collections.abc import Callable, Collection, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.challenge.real.campaigns import CAMPAIGNS, GROUPS, Campaign
from diagrams.challenge.real.rules import Case
from np_drake.logs.importing.log_map import load_map_file
from np_drake.logs.opening import read_as_logged

RULE = (
    (
        "Flights go by name; after the last comes the first again. No flight judges what was "
        "fitted to it."
    ),
    (
        "payload, bare: a block is a run of flight numbers, of which single ones may lack: one "
        "manoeuvre. Fit"
    ),
    (
        "two flights of a block, judge the first of the next; fit the last of each of the two "
        "blocks after,"
    ),
    (
        "judge the last. Thrust is of rotor speed; payload-command: the second half, by "
        "commanded thrust."
    ),
    (
        "idsia, nanobench: judge the first flight of a manoeuvre, fit the last of each of the "
        "two after."
    ),
    (
        "crazyswarm2, swarm-single, swarm-ground, neurobem: judge a flight, fit the two after "
        "(neurobem: three)."
    ),
    (
        "swarm-single: height above 0.5 m for 95 % of the flight; swarm-ground: not above 0.15 "
        "m for so long."
    ),
    (
        "swarm-downwash: judge the last flight of a vehicle, fit those before, two at most; "
        "the log of the other vehicle"
    ),
    "is given. swarm-downwash-alone: the same without it.",
    "wind, still: for every path and wind judge each controller, fit the two after it.",
    (
        "new-wind: judge a flight in wind, fit the still flights of the two controllers after; "
        "second answer."
    ),
    (
        "Where a rule gives more cases than a campaign takes, they are picked evenly from the "
        "first to the last."
    ),
)


def make_cases(
    folder: Path, neurobem: Path | None = None, only: Collection[str] = ()
) -> list[Case]:
    """Return the cases of all groups, or of those named, that the folders hold flights for.

    Args:
        folder: holds the folders of the campaigns, or some of them.
        neurobem: NeuroBEM data set; None: no case of it.
    Raises: ValueError: if a folder is missing, a group unknown, or no case can be made; LogError:
        if the height of a flight counts and cannot be read.
    """
    if unknown := sorted(set(only) - set(GROUPS)):
        raise ValueError(f"--only: must be of {', '.join(GROUPS)}; got {', '.join(unknown)}.")
    for given in (folder, neurobem):
        if given is not None and not given.is_dir():
            raise ValueError(f"{given}: must be a folder of real flights; it is not there.")
    wanted = [campaign for campaign in CAMPAIGNS if not only or campaign.group in only]
    cases = [case for campaign in wanted for case in _of_campaign(campaign, folder, neurobem)]
    if not cases:
        raise ValueError(
            f"{folder}: must hold flights enough for a case of "
            f"{', '.join(c.group for c in wanted)}; got none. They "
            f"lie in "
            f"{', '.join(dict.fromkeys(pattern for c in wanted for pattern in c.patterns))}, three at least."  # noqa: E501
        )
    return cases


def _of_campaign(campaign: Campaign, folder: Path, neurobem: Path | None) -> list[Case]:
    files = campaign.files(folder, neurobem)
    if campaign.height is not None:
        low, high = campaign.height
        files = [path for path in files if low <= exceeded_height(path, campaign.map) <= high]
    return evenly(list(campaign.rule(campaign.group, files)), campaign.most)


def evenly(cases: Sequence[Case], most: int) -> list[Case]:
    """Return cases evenly from the first to the last."""
    picked = np.linspace(0, len(cases) - 1, min(most, len(cases))).round().astype(int)
    return [cases[i] for i in picked]


@lru_cache(maxsize=256)
def exceeded_height(path: Path, log_map: str = "") -> float:
    """Return the height that the flights of a log exceed 95 % of the time [m].

    Args:
        log_map: preset of `import`; empty: none.
    Raises: LogError: if it cannot be read.
    """
    opened = read_as_logged(path, load_map_file(log_map) if log_map else None)
    return float(np.quantile(np.concatenate([log.p[:, 2] for log in opened.flights]), 0.05))


@dc.dataclass(frozen=True)
class OfNamedCase:
    """Work of a record {"group", "name"} -> `work` of the case of that name.

    folder, neurobem: of the real flights, under the same path for all workers.
    """

    work: Callable[[Case], dict[str, Any]]
    folder: Path
    neurobem: Path | None

    def __call__(self, record: dict[str, Any]) -> dict[str, Any]:
        """Return the result of the case."""
        return self.work(_by_name(self.folder, self.neurobem, record["group"])[record["name"]])


@lru_cache(maxsize=64)
def _by_name(folder: Path, neurobem: Path | None, group: str) -> dict[str, Case]:
    return {case.name: case for case in make_cases(folder, neurobem, [group])}
