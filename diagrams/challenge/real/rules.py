"""Rules by which the flights of a campaign become cases: which are fitted and which judge, by name
and not by choice.

A rule takes the name of a group and its files, sorted by name, and yields cases. No flight judges
its own fit.
"""

import dataclasses as dc
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path

from diagrams.challenge.real.flight_names import (
    STILL,
    Flown,
    block_name,
    flown_in_wind,
    following,
    label,
    numbered_blocks,
)


@dc.dataclass(frozen=True)
class Case:
    """Flights that are fitted and the one that judges.

    group: of its campaign.
    name: what is fitted -> what judges, or the latter alone.
    still: flights of the same path and controllers without wind, from which the mean force of a
        wind counts.
    speed: of the wind in the flight that judges [m/s].
    second: the second answer is asked for, what the held-out flight shows and the others do not.
    """

    group: str
    name: str
    train: tuple[Path, ...]
    held_out: Path
    still: tuple[Path, ...] = ()
    speed: float = 0.0
    second: bool = False

    @property
    def folder(self) -> Path:
        """Folder of its answer below that of all answers: `<group>/<name>`, of letters, digits and
        `._+-` alone.
        """
        return Path(self.group) / re.sub(
            r"[^\w.+-]+", "_", self.name.replace(" -> ", "_to_").replace(" + ", "+")
        )


Rule = Callable[[str, Sequence[Path]], Iterable[Case]]


def in_circle(count: int = 2) -> Rule:
    """Return the rule that every flight judges once what is fitted to the `count` after it, or to
    all others.
    """

    def cases(group: str, files: Sequence[Path]) -> Iterator[Case]:
        for i, held_out in enumerate(files if len(files) > 1 else ()):
            yield Case(
                group,
                label(held_out),
                tuple(following(files, i, min(count, len(files) - 1))),
                held_out,
            )

    return cases


def by_manoeuvre(pattern: str) -> Rule:
    """Return the rule that of every manoeuvre the first flight judges the last of each of the two
    after it.

    Args: pattern: regular expression that the beginning of a name matches; its group is the
    manoeuvre.
    """

    def cases(group: str, files: Sequence[Path]) -> Iterator[Case]:
        flown = _by(pattern, files)
        for i, own in enumerate(flown if len(flown) > 1 else ()):
            others = following(flown, i, min(2, len(flown) - 1))
            yield Case(group, label(own[0]), tuple(other[-1] for other in others), own[0])

    return cases


def by_vehicle(pattern: str) -> Rule:
    """Return the rule that of every vehicle the last flight judges what is fitted to the two before
    it, or the one.

    Args: pattern: regular expression that the beginning of a name matches; its group is the
    vehicle.
    """

    def cases(group: str, files: Sequence[Path]) -> Iterator[Case]:
        for *before, last in _by(pattern, files):
            if before:
                yield Case(group, label(last), tuple(before[-2:]), last)

    return cases


def _by(pattern: str, files: Iterable[Path]) -> list[list[Path]]:
    """Return the files in lists of what the group of a pattern finds in their names; those without
    are left out.
    """
    found = [(match[1], path) for path in files if (match := re.match(pattern, path.name))]
    return [
        [path for _, path in own] for _, own in groupby(sorted(found), key=lambda pair: pair[0])
    ]


def block_by_block(group: str, files: Sequence[Path]) -> Iterator[Case]:
    """Yield a case for every block of numbers: it is fitted, two flights of it, and the next one
    judges.
    """
    for block, (other,) in _before_others(files, 1):
        if len(block) > 1:
            yield Case(
                group, f"{block_name(block)} -> {block_name(other)}", tuple(block[:2]), other[0]
            )


def across_blocks(group: str, files: Sequence[Path]) -> Iterator[Case]:
    """Yield a case for every block of numbers: it judges what is fitted to a flight each of the two
    blocks after it.
    """
    for block, others in _before_others(files, 2):
        name = f"{' + '.join(block_name(b) for b in others)} -> {block_name(block)}"
        yield Case(group, name, tuple(b[-1] for b in others), block[-1])


def _before_others(
    files: Sequence[Path], count: int
) -> Iterator[tuple[list[Path], list[list[Path]]]]:
    """Yield every block of numbers with the `count` blocks after it; none where there are no
    more.
    """
    blocks = numbered_blocks(files)
    for i, block in enumerate(blocks if len(blocks) > count else ()):
        yield block, list(following(blocks, i, count))


def by_blocks(group: str, files: Sequence[Path]) -> Iterator[Case]:
    """Yield the cases of `block_by_block`, then those of `across_blocks`."""
    yield from block_by_block(group, files)
    yield from across_blocks(group, files)


def in_wind(group: str, files: Sequence[Path]) -> Iterator[Case]:
    """Yield a case for every path, wind and controller: the controller is held out, the two after
    it are fitted.
    """
    flown = flown_in_wind(files)
    for (path_name, wind), some in groupby(flown, key=lambda f: (f.path_name, f.wind)):
        alike = list(some)
        if wind == STILL or len(alike) < 3:
            continue
        still = {f.controller: f.path for f in flown if (f.path_name, f.wind) == (path_name, STILL)}
        for i, held_out in enumerate(alike):
            fitted = following(alike, i, 2)
            same = tuple(still[f.controller] for f in fitted if f.controller in still)
            yield _held_out(group, wind, fitted, held_out, still=same, speed=held_out.speed)


def in_still_air(group: str, files: Sequence[Path]) -> Iterator[Case]:
    """Yield a case for every path and controller without wind: it is held out, the two after it are
    fitted.
    """
    calm = [f for f in flown_in_wind(files) if f.wind == STILL]
    for _, some in groupby(calm, key=lambda f: f.path_name):
        alike = list(some)
        for i, held_out in enumerate(alike if len(alike) > 2 else ()):
            yield _held_out(group, STILL, following(alike, i, 2), held_out)


def into_wind(group: str, files: Sequence[Path]) -> Iterator[Case]:
    """Yield a case for every flight in wind: what is fitted was flown in still air by the two
    controllers after it.
    """
    flown = flown_in_wind(files)
    for held_out in flown:
        still = [f for f in flown if f.wind == STILL and f.path_name == held_out.path_name]
        others = [f for f in still if f.controller > held_out.controller]
        others += [f for f in still if f.controller < held_out.controller]
        if held_out.wind == STILL or len(others) < 2:
            continue
        name = f"still {_controllers(others[:2])} -> {held_out.wind} {held_out.controller}"
        train = tuple(f.path for f in others[:2])
        yield Case(group, name, train, held_out.path, speed=held_out.speed, second=True)


def _held_out(
    group: str,
    wind: str,
    fitted: Sequence[Flown],
    held_out: Flown,
    still: tuple[Path, ...] = (),
    speed: float = 0.0,
) -> Case:
    name = f"{wind} {_controllers(fitted)} -> {held_out.controller}"
    return Case(group, name, tuple(f.path for f in fitted), held_out.path, still, speed)


def _controllers(flown: Sequence[Flown]) -> str:
    return " + ".join(f.controller for f in flown)
