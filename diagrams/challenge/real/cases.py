"""Cases of the real flights: which flights are fitted and which judge, by a rule and not by choice."""

import dataclasses as dc
from collections.abc import Callable, Collection, Iterator, Sequence
from functools import lru_cache
from itertools import groupby, permutations
from pathlib import Path
from typing import Any

from diagrams.challenge.real.campaigns import (
    BARE,
    NEURAL_FLY,
    PAYLOAD,
    STILL,
    Flown,
    block_name,
    files_of,
    flown_in_wind,
    following,
    numbered_blocks,
)
from np_drake.logs.formats.neurobem import AGILE

GROUPS = ("payload", "payload-command", "bare", "wind", "still", "new-wind", "neurobem")
RULE = (
    "A block is a run of consecutive flight numbers, of which single ones may lack: one manoeuvre.",
    "payload, bare: for every ordered pair of blocks A, B: fit the first two of A, judge the first of B;",
    "and for every block C: fit the last of each of the two blocks after C, judge the last of C.",
    "They take thrust and torque from rotor speed; payload-command those commanded, the second half.",
    "wind, still: for every path and wind: judge each controller, fit the two after it.",
    "new-wind: for every flight in wind: judge it, fit the still flights of the two controllers after.",
    "neurobem: judge each agile flight, fit the others. After the last comes the first again.",
    "No flight judges what was fitted to it; new-wind alone asks for the second answer.",
)


@dc.dataclass(frozen=True)
class Case:
    """Flights that are fitted and the one that judges.

    group: one of `GROUPS`.   name: what is fitted -> what judges.   still: flights of the same path and controllers
    without wind, from which the mean force of a wind counts.   speed: of the wind in the flight that judges [m/s].
    """

    group: str
    name: str
    train: tuple[Path, ...]
    held_out: Path
    still: tuple[Path, ...] = ()
    speed: float = 0.0

    @property
    def second(self) -> bool:
        """Whether the second answer is asked for: what the held-out flight shows that the others do not."""
        return self.group == "new-wind"


def make_cases(folder: Path, neurobem: Path | None = None, only: Collection[str] = ()) -> list[Case]:
    """Return the cases of all groups, or of those named, that the folders hold flights for.

    Args:
        folder: holds `imrc/bare`, `imrc/payload` and `neural_fly`, or some of them.
        neurobem: NeuroBEM data set; None: no case of it.
        only: groups; empty: all.
    Raises: ValueError: if a folder is missing, a group unknown, or no case can be made.
    """
    if unknown := sorted(set(only) - set(GROUPS)):
        raise ValueError(f"--only: must be of {', '.join(GROUPS)}; got {', '.join(unknown)}.")
    for given in (folder, neurobem):
        if given is not None and not given.is_dir():
            raise ValueError(f"{given}: must be a folder of real flights; it is not there.")
    wanted = only or GROUPS
    cases = [case for case in _all(folder, neurobem) if case.group in wanted]
    if not cases:
        raise ValueError(
            f"{folder}: must hold flights in {BARE}, {PAYLOAD} or {NEURAL_FLY}, enough for a case of "
            f"{', '.join(wanted)}; got none. A block needs two flights, a wind three controllers."
        )
    return cases


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
        return self.work(_by_name(self.folder, self.neurobem)[record["group"], record["name"]])


@lru_cache(maxsize=4)
def _by_name(folder: Path, neurobem: Path | None) -> dict[tuple[str, str], Case]:
    return {(case.group, case.name): case for case in make_cases(folder, neurobem)}


def _all(folder: Path, neurobem: Path | None) -> Iterator[Case]:
    payload = numbered_blocks(files_of(folder / PAYLOAD))
    yield from block_pairs("payload", payload)
    yield from across_blocks("payload", payload)
    yield from across_blocks("payload-command", payload)
    bare = numbered_blocks(files_of(folder / BARE))
    yield from block_pairs("bare", bare)
    yield from across_blocks("bare", bare)
    flown = flown_in_wind(files_of(folder / NEURAL_FLY))
    yield from within_wind(flown)
    yield from into_wind(flown)
    if neurobem is not None:
        yield from _agile_folds(neurobem)


def block_pairs(group: str, blocks: Sequence[Sequence[Path]]) -> Iterator[Case]:
    """Yield a case for every ordered pair of blocks: two flights of the first are fitted, one of the other judges.

    Args:
        group: of the cases.
        blocks: logs by manoeuvre.
    """
    for a, b in permutations(blocks, 2):
        if len(a) > 1:
            yield Case(group, f"{block_name(a)} -> {block_name(b)}", tuple(a[:2]), b[0])


def across_blocks(group: str, blocks: Sequence[Sequence[Path]]) -> Iterator[Case]:
    """Yield a case for every block: it judges what is fitted to a flight each of the two blocks after it.

    Args:
        group: of the cases.
        blocks: logs by manoeuvre.
    """
    if len(blocks) < 3:
        return
    for i, block in enumerate(blocks):
        others = following(blocks, i, 2)
        name = f"{' + '.join(block_name(b) for b in others)} -> {block_name(block)}"
        yield Case(group, name, tuple(b[-1] for b in others), block[-1])


def within_wind(flown: Sequence[Flown]) -> Iterator[Case]:
    """Yield a case for every path, wind and controller: the controller is held out."""
    for (_, wind), some in groupby(flown, key=lambda f: (f.path_name, f.wind)):
        alike = list(some)
        if len(alike) < 3:
            continue
        still = [f for f in flown if f.wind == STILL and f.path_name == alike[0].path_name]
        for i, held_out in enumerate(alike):
            fitted = following(alike, i, 2)
            yield Case(
                "still" if wind == STILL else "wind",
                f"{wind} {_controllers(fitted)} -> {held_out.controller}",
                tuple(f.path for f in fitted),
                held_out.path,
                tuple(f.path for f in still if f.controller in {g.controller for g in fitted}),
                held_out.speed,
            )


def into_wind(flown: Sequence[Flown]) -> Iterator[Case]:
    """Yield a case for every flight in wind: what is fitted was flown in still air by two other controllers."""
    for held_out in flown:
        still = [f for f in flown if f.wind == STILL and f.path_name == held_out.path_name]
        others = [f for f in still if f.controller > held_out.controller]
        others += [f for f in still if f.controller < held_out.controller]
        if held_out.wind == STILL or len(others) < 2:
            continue
        fitted = others[:2]
        name = f"still {_controllers(fitted)} -> {held_out.wind} {held_out.controller}"
        yield Case("new-wind", name, tuple(f.path for f in fitted), held_out.path, speed=held_out.speed)


def _agile_folds(folder: Path) -> Iterator[Case]:
    """Yield a case for every agile flight of the NeuroBEM data set, as `reproduce gap`."""
    paths = [folder / "csv" / f"merged_{name}.csv" for name in AGILE]
    for name, held_out in zip(AGILE, paths, strict=True):
        yield Case("neurobem", f"others -> {name}", tuple(p for p in paths if p != held_out), held_out)


def _controllers(flown: Sequence[Flown]) -> str:
    return " + ".join(f.controller for f in flown)
