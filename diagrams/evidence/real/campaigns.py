"""Campaigns of real flights (campaigns.yaml), what is known of them, and the cases of their files.

A rule takes the name of a group and its files, sorted by name, and yields cases: which flights are
fitted and which judge, by name and not by choice. No flight judges its own fit.
"""

import dataclasses as dc
import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.batch.run import require
from diagrams.evidence.studies.options import chosen
from np_drake.files.yaml_file import read_yaml
from np_drake.flight_log import FlightLog
from np_drake.logs import opening
from np_drake.logs.errors import LogError
from np_drake.logs.formats import crazyflie
from np_drake.logs.importing.log_map import LogMap, MapFile, load_map_file
from np_drake.logs.opening import with_neighbours
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.estimate import Measured, estimate

WINDS = ("constant_wind", "gusty_wind")
DRAG = "linear_drag"
PAYLOAD = "suspended_payload"
GROUND = "ground_effect"
PLACE = "place"  # finding of the unknown: a slow force that is tied to a place
NAMED = 0.5  # probability above which a cause counts as named [1]
FULL_FANS = 12.1  # wind of the fans at 100 per cent; other settings are in proportion [m/s]
STILL = "nowind"
PREFIX = re.compile(r"^(dataset|merged)_")  # of the logs of a data set
NUMBERED = re.compile(r"(?P<stem>.*?)(?P<number>\d+)(\.\w+)?")
IN_WIND = re.compile(
    r"(?P<track>.+)_(?P<who>[^_]+)_(?P<wind>nowind|(?P<power>\d+)(p\d+sint|wind))\.csv(\.gz)?"
)


@dc.dataclass(frozen=True)
class Truth:
    """What is known of a group of flights, with its source; drag is real in all of them.

    false: effects that are not there.
    present: one of these names is the known cause; empty: nothing is attached and no wind blows.
    All others are not known, and are neither right nor wrong: trim, calibration and aerodynamics of
        these vehicles were not measured.
    parameters: of the known cause, each with its `value` [SI] and the range `asked` for, over it.
    healthy: nothing acts but the air and the vehicle's own errors, all flight long, so that what
        begins in flight, and a force that is tied to a place, are not there either.
    """

    source: str
    false: Sequence[str]
    present: Sequence[str] = ()
    parameters: Mapping[str, Mapping[str, Any]] = dc.field(default_factory=dict)
    healthy: bool = False

    def holds(self, name: str, late: Collection[str] = ()) -> bool | None:
        """Return whether an effect is there; None where it is not known."""
        if self.healthy and (name in late or name == PLACE):
            return False
        if name == DRAG or name in self.present:
            return True
        return False if name in self.false else None

    def wrong(self, causes: Mapping[str, float], late: Collection[str] = ()) -> list[str]:
        """Return the named causes that are not there, from probabilities by name [1]."""
        return [name for name in named(causes) if self.holds(name, late) is False]

    def right(self, causes: Mapping[str, float], late: Collection[str] = ()) -> bool:
        """Return whether the known cause is named, where there is one, and none is that is not
        there.
        """
        is_named = not self.present or bool(set(self.present) & set(named(causes)))
        return is_named and not self.wrong(causes, late)


def named(causes: Mapping[str, float]) -> list[str]:
    """Return the names of causes with a probability above one half."""
    return [name for name, p in causes.items() if p > NAMED]


@dc.dataclass(frozen=True)
class Case:
    """Flights that are fitted and the one that judges.

    group: of its campaign.
    name: what is fitted -> what judges, or the latter alone.
    still: flights of the same path and controllers without wind, from which the mean force of a
        wind counts.
    speed: of the wind in the flight that judges [m/s].
    second: the second answer is asked for, what the held-out flight shows and the others do not.
    before: flights of the vehicle before, since which the change is asked for.
    """

    group: str
    name: str
    train: tuple[Path, ...]
    held_out: Path
    still: tuple[Path, ...] = ()
    speed: float = 0.0
    second: bool = False
    before: tuple[Path, ...] = ()

    @property
    def folder(self) -> Path:
        """Folder of its answer below that of all answers: `<group>/<name>`, of letters, digits and
        `._+-` alone.
        """
        name = self.name.replace(" -> ", "_to_").replace(" + ", "+")
        return Path(self.group) / re.sub(r"[^\w.+-]+", "_", name)


# Rules


def following(items: Sequence, index: int, count: int) -> list:
    """Return the items after one, in a circle; no more than there are others."""
    return [items[(index + 1 + k) % len(items)] for k in range(min(count, len(items) - 1))]


def _alike(pattern: str, files: Iterable[Path]) -> list[list[Path]]:
    """Return the files in lists of what the group of a pattern finds at the beginning of their
    names; those without are left out.
    """
    alike: dict[str, list[Path]] = {}
    for path in files:
        if match := re.match(pattern, path.name):
            alike.setdefault(match[1], []).append(path)
    return [sorted(alike[beginning]) for beginning in sorted(alike)]


def in_circle(
    group: str, files: Sequence[Path], pattern: str = "(.*)", count: int = 2
) -> Iterator[Case]:
    """Yield a case for every manoeuvre, or every flight where the pattern is of the whole name: its
    first flight judges what is fitted to the last of each of the `count` after it.
    """
    flown = _alike(pattern, files)
    for i, (first, *_) in enumerate(flown if len(flown) > 1 else ()):
        train = tuple(other[-1] for other in following(flown, i, count))
        yield Case(group, PREFIX.sub("", first.name.split(".")[0]), train, first)


def by_vehicle(group: str, files: Sequence[Path], pattern: str) -> Iterator[Case]:
    """Yield a case for every vehicle: its last flight judges the two before it, or the one."""
    for *train, last in _alike(pattern, files):
        if train:
            yield Case(group, last.name.split(".")[0], tuple(train[-2:]), last)


def numbered_blocks(paths: Iterable[Path]) -> list[list[Path]]:
    """Return the files whose names end in a number, in blocks of consecutive numbers, of which
    single ones may lack.

    A block is one manoeuvre: the campaign was flown block by block, and spoilt flights were left
    out.
    """
    numbered = sorted(
        (m["stem"], int(m["number"]), path)
        for path in paths
        if (m := NUMBERED.fullmatch(path.name))
    )
    blocks: list[list[Path]] = []
    last = ("", -math.inf)
    for stem, number, path in numbered:
        if stem != last[0] or number - last[1] > 2:
            blocks.append([])
        blocks[-1].append(path)
        last = (stem, number)
    return blocks


def block_name(block: Sequence[Path]) -> str:
    """Return the numbers of a block, as `06-10`."""
    first, last = (NUMBERED.fullmatch(path.name)["number"] for path in (block[0], block[-1]))  # type: ignore[index]
    return first if first == last else f"{first}-{last}"


def across_blocks(group: str, files: Sequence[Path]) -> Iterator[Case]:
    """Yield a case for every block of numbers: it judges what is fitted to a flight each of the two
    blocks after it.
    """
    blocks = numbered_blocks(files)
    for i, block in enumerate(blocks if len(blocks) > 2 else ()):
        others = following(blocks, i, 2)
        name = f"{' + '.join(map(block_name, others))} -> {block_name(block)}"
        yield Case(group, name, tuple(other[-1] for other in others), block[-1])


def by_blocks(group: str, files: Sequence[Path]) -> Iterator[Case]:
    """Yield a case for every block of numbers: it is fitted, two flights of it, and the next one
    judges; then the cases of `across_blocks`.
    """
    blocks = numbered_blocks(files)
    for i, block in enumerate(blocks):
        for other in following(blocks, i, 1) if len(block) > 1 else ():
            name = f"{block_name(block)} -> {block_name(other)}"
            yield Case(group, name, tuple(block[:2]), other[0])
    yield from across_blocks(group, files)


def by_controller(
    group: str, files: Sequence[Path], windy: bool, fit_still: bool = False
) -> Iterator[Case]:
    """Yield a case for every track, wind and controller of Neural-Fly: it is held out, the two
    controllers after it are fitted, in the same wind or in still air.

    windy: the held-out flight is in wind; else in still air.
    """
    # By track, speed of the fans [m/s] and setting, such as nowind, 35wind or 70p20sint: the flight
    # of every controller.
    flown: dict[tuple[str, float, str], dict[str, Path]] = {}
    for path in files:
        if m := IN_WIND.fullmatch(path.name):
            setting = (m["track"], FULL_FANS * int(m["power"] or 0) / 100, m["wind"])
            flown.setdefault(setting, {})[m["who"]] = path
    for (track, speed, wind), flights in sorted(flown.items()):
        calm = flown.get((track, 0.0, STILL), {})
        fitted = calm if fit_still else flights
        for who in sorted(flights if windy == (wind != STILL) else ()):
            # The two after it, in a circle.
            names = sorted(fitted.keys() - {who}, key=lambda name: (name < who, name))[:2]
            before, after = ("still", f"{wind} {who}") if fit_still else (wind, who)
            if len(names) == 2:
                yield Case(
                    group,
                    f"{before} {' + '.join(names)} -> {after}",
                    tuple(fitted[name] for name in names),
                    flights[who],
                    tuple(calm[n] for n in names if n in calm and windy and not fit_still),
                    speed,
                    second=fit_still,
                )


RULES: Mapping[str, Callable[..., Iterator[Case]]] = {
    rule.__name__: rule for rule in (in_circle, by_vehicle, by_blocks, across_blocks, by_controller)
}


# Campaigns


@dc.dataclass(frozen=True, eq=False)
class Campaign:
    """Flights of one vehicle under one condition; fields as in campaigns.yaml."""

    group: str
    vehicle: str
    patterns: Sequence[str]
    nominal: Vehicle
    truth: Truth
    rule: Callable[[str, Sequence[Path]], Iterator[Case]]
    most: int = 4
    map: str = ""
    height: tuple[float, float] | None = None
    of_neurobem: bool = False
    neighbours: Mapping[str, str] = dc.field(default_factory=dict)
    before: Sequence[str] = ()

    def files(
        self, real: Path, neurobem: Path | None = None, *, before: bool = False
    ) -> list[Path]:
        """Return the logs that lie there, or those of before, of any height, by name; hidden ones
        apart.

        neurobem: folder of NeuroBEM; None: there is none.
        """
        root = neurobem if self.of_neurobem else real
        patterns = self.before if before else self.patterns
        paths = {path for pattern in patterns for path in root.glob(pattern)} if root else ()
        logs = (path for path in paths if path.is_file() and not path.name.startswith("."))
        return sorted(logs, key=lambda path: (path.name, path))

    def logs(self, paths: Iterable[Path]) -> list[FlightLog]:
        """Return the flights of logs, as `open_flights`."""
        return [log for path in paths for log in self.open_flights(path)]

    def open_flights(self, path: Path) -> list[FlightLog]:
        """Return the flights of a log, a Crazyflie's by its commands where the vehicle asks for
        them, with the path of the vehicle that flew beside them, where the campaign gives its log.

        Raises: LogError: one line with file and reason; OSError: if it cannot be opened.
        """
        log_map: LogMap | MapFile | None = load_map_file(self.map) if self.map else None
        if not self.map and self.nominal.input == "command":
            log_map = _commanded(path)
        flights, _ = opening.open_flights(path, self.nominal, log_map)
        for vehicle in (one for one in self.neighbours if path.name.startswith(one)):
            other = path.with_name(self.neighbours[vehicle] + path.name.removeprefix(vehicle))
            flown, _ = opening.open_flights(other, self.nominal, log_map)
            near = {log.name: flown for log in flights}
            flights = with_neighbours(flights, near, self.nominal.rotor_radius)
        return flights


def _vehicle(
    preset: str = "", mass: float = 0.0, measured: dict[str, Any] | None = None, **more: Any
) -> Vehicle:
    """Return the vehicle that a campaign states: a preset, or what its owner measured; of another
    mass [kg], and with other fields.
    """
    vehicle = load_vehicle(preset) if preset else Vehicle()
    if measured:
        vehicle = estimate(Measured(**measured), more["name"])
    return dc.replace(vehicle.with_mass(mass) if mass else vehicle, **more).check()


def _campaign(nominal: dict, truth: dict, rule: dict, **more: Any) -> Campaign:
    """Return a campaign of the fields of campaigns.yaml."""
    options = {key: value for key, value in rule.items() if key != "name"}
    return Campaign(
        nominal=_vehicle(**nominal),
        truth=Truth(**truth),
        rule=partial(RULES[rule["name"]], **options),
        **more,
    )


_FACTS = read_yaml(Path(__file__).with_suffix(".yaml"))
RULE = tuple(_FACTS["rule"])
CASES = _FACTS["cases"]
ASKED = _FACTS["asked"]
BINS = _FACTS["bins"]
CAMPAIGNS = tuple(_campaign(**fields) for fields in _FACTS["campaigns"])
GROUPS = tuple(campaign.group for campaign in CAMPAIGNS)


def campaign_of(group: str) -> Campaign:
    """Return the campaign whose cases have this name."""
    return CAMPAIGNS[GROUPS.index(group)]


def make_cases(
    folder: Path, neurobem: Path | None = None, only: Collection[str] = ()
) -> list[Case]:
    """Return the cases of all groups, or of those named, that the folders hold flights for.

    folder: holds the folders of the campaigns, or some of them. neurobem: NeuroBEM data set; None:
    no case of it.
    Raises: ValueError: if a folder is missing, a group unknown, or no case can be made; LogError:
        if the height of a flight counts and cannot be read.
    """
    groups = chosen("--only", only, GROUPS)
    for given in (folder, neurobem):
        require(
            given is None or given.is_dir(),
            f"{given}: must be a folder of real flights; it is not there.",
        )
    wanted = [campaign for campaign in CAMPAIGNS if campaign.group in groups]
    cases: list[Case] = []
    for campaign in wanted:
        files = campaign.files(folder, neurobem)
        if campaign.height is not None:
            low, high = campaign.height
            files = [path for path in files if low <= exceeded_height(path) <= high]
        made = list(campaign.rule(campaign.group, files))
        picked = np.linspace(0, len(made) - 1, min(campaign.most, len(made))).round()
        earlier = campaign.files(folder, before=True)
        for k, i in enumerate(picked.astype(int).tolist()):  # evenly from the first to the last
            case = made[i]
            unused = [path for path in earlier if path not in (*case.train, case.held_out)]
            two = dict.fromkeys((unused * 2)[k % max(len(unused), 1) :][:2])  # in a circle
            cases.append(dc.replace(case, before=tuple(two)))
    places = dict.fromkeys(pattern for campaign in wanted for pattern in campaign.patterns)
    require(
        bool(cases),
        f"{folder}: must hold flights enough for a case of {', '.join(groups)}; got none. They lie "
        f"in {', '.join(places)}, three at least.",
    )
    return cases


@lru_cache(maxsize=256)
def exceeded_height(path: Path) -> float:
    """Return the height that the flights of a log exceed 95 % of the time [m].

    Raises: LogError: if it cannot be read.
    """
    flights = opening.read_as_logged(path, None).flights
    return float(np.quantile(np.concatenate([log.p[:, 2] for log in flights]), 0.05))


@lru_cache(maxsize=64)
def _commanded(path: Path) -> LogMap:
    """Return the map of a Crazyflie log that takes the commanded thrust and torque, not the rotor
    speed.

    Raises: LogError: if the log has no such command.
    """
    contents = {
        event: tuple(name for name in names if not name.startswith("rpm."))
        for event, names in crazyflie.contents(path).items()
    }
    log_map = crazyflie.default_map(contents)
    if log_map is None or not log_map.thrust or not log_map.torque:
        raise LogError(f"{path}: must hold the commanded thrust and torque (ctrlLee); it does not.")
    return log_map
