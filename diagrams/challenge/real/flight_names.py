"""What the names of flights tell: block and number, path, controller and wind, and what to call
them.
"""

import dataclasses as dc
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

FULL_FANS = 12.1  # wind of the fans at 100 per cent; other settings are in proportion [m/s]
STILL = "nowind"
MISSING = 1  # numbers that a block may lack between two flights: of spoilt ones; own choice
PREFIX = re.compile(r"^(dataset|merged)_")
NUMBERED = re.compile(r"(?P<stem>.*?)(?P<number>\d+)(\.\w+)?")
IN_WIND = re.compile(
    r"(?P<path>.+)_(?P<controller>[^_]+)_(?P<wind>nowind|\d+(p\d+sint|wind))\.csv(\.gz)?"
)


@dc.dataclass(frozen=True)
class Flown:
    """File of a Neural-Fly flight, with the controller and the setting of the fans that its name
    tells.

    path_name: what was flown, as `custom_figure8`.
    """

    path: Path
    path_name: str
    controller: str
    wind: str

    @property
    def speed(self) -> float:
        """Mean speed of the air that the fans blow [m/s]."""
        return wind_speed(self.wind)


def wind_speed(setting: str) -> float:
    """Return the mean speed that a setting such as `nowind`, `35wind` or `70p20sint` stands for
    [m/s].
    """
    return (
        0.0 if setting == STILL else FULL_FANS * int(re.split(r"\D", setting, maxsplit=1)[0]) / 100
    )


def numbered_blocks(paths: Iterable[Path]) -> list[list[Path]]:
    """Return the files whose names end in a number, in blocks of consecutive numbers, of which
    single ones may lack.

    A block is one manoeuvre: the campaign was flown block by block, and spoilt flights were left
    out.
    """
    found = sorted(
        (match["stem"], int(match["number"]), path)
        for path in paths
        if (match := NUMBERED.fullmatch(path.name))
    )
    blocks: list[list[Path]] = []
    previous: tuple[str, int] | None = None
    for stem, number, path in found:
        if previous is not None and previous[0] == stem and number - previous[1] <= 1 + MISSING:
            blocks[-1].append(path)
        else:
            blocks.append([path])
        previous = (stem, number)
    return blocks


def block_name(block: Sequence[Path]) -> str:
    """Return the numbers of a block, as `06-10`."""
    first, last = (NUMBERED.fullmatch(path.name)["number"] for path in (block[0], block[-1]))  # type: ignore[index]
    return first if first == last else f"{first}-{last}"


def flown_in_wind(paths: Iterable[Path]) -> list[Flown]:
    """Return the flights whose names tell path, controller and wind, by path, wind and
    controller.
    """
    found = [
        Flown(path, match["path"], match["controller"], match["wind"])
        for path in paths
        if (match := IN_WIND.fullmatch(path.name))
    ]
    return sorted(found, key=lambda f: (f.path_name, f.speed, f.wind, f.controller))


def label(path: Path) -> str:
    """Return what a log is called: its name without what all names of a data set begin and end
    with.
    """
    return PREFIX.sub("", path.name.split(".")[0])


def following(items: Sequence, index: int, count: int) -> list:
    """Return the items after one, in a circle."""
    return [items[(index + 1 + k) % len(items)] for k in range(count)]
