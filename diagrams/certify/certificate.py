"""Certificate: where in the ranges a vehicle may be flown, with an exact bound of how often it
fails there.

Half of the flights explore: first evenly, then at the border of what fails too often. The largest
part of the map in which they failed seldom enough is chosen. The other half are drawn in that part
alone, after it was chosen: their failures are binomial, and Clopper-Pearson's bound is exact. A
cell may be flown that is of the part, where that bound is within the limit.
"""

import dataclasses as dc
import math
from collections.abc import Sequence
from functools import partial
from itertools import combinations_with_replacement
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from scipy import ndimage, special, stats

from diagrams.batch.run import Case, Run, every_result, make_folder, require
from diagrams.certify.ranges import Range, drawn_flight, with_value
from diagrams.gap.corrected import stated
from diagrams.loop.experiments import settings_of
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import LostVehicle, fly
from np_drake.diagnosis.gap import manoeuvre
from np_drake.effects.library import in_scenarios
from np_drake.files.figure_file import PALETTE, Figure, new_figure
from np_drake.files.file_access import plain, write_text
from np_drake.files.number_text import number
from np_drake.identification.quantities import QUANTITIES
from np_drake.vehicle.sources import part

FEWEST = 4  # flights a cell of the map
MOST_CELLS = 8  # along a range: every part of so many is tried
ROUNDS = 4  # of exploring at the border
DRIVERS = 8  # quantities that a table shows
NOTED = 2.0  # rank correlation over that of chance, from which a quantity counts [1]; own choice
MOST_KEPT = 20  # failed flights that are written as scenario files
EVEN = "flying"
EXPLORING = "exploring"
CONFIRMING = "confirming"
# of a cell
YES = "yes"
NOT_SHOWN = "not shown"
NO = "no"


@dc.dataclass(frozen=True)
class Bound:
    """Failures among independent flights, and Clopper-Pearson's one-sided bound of their rate."""

    failures: int
    flights: int
    confidence: float  # [1]

    @property
    def upper(self) -> float:
        """Rate that is not exceeded, with the confidence [1]; 1 where nothing has flown."""
        k = self.failures
        n = self.flights
        return 1.0 if k == n else stats.beta.ppf(self.confidence, k + 1, n - k)

    def lacking(self, limit: float) -> int | None:
        """Return how many more flights without a failure bring the bound to a limit [1]; None where
        the failures show, with the same confidence, that the rate is larger.
        """
        k = self.failures
        n = self.flights
        unsure = 1 - self.confidence
        if k and stats.beta.ppf(unsure, k, n - k + 1) > limit:
            return None
        return max(int(np.ceil(special.bdtrin(k, unsure, limit) - 1e-9)) - n, 0)

    @property
    def at_most(self) -> str:
        """The bound in per cent, rounded up to two digits."""
        digit = 10.0 ** (np.floor(np.log10(100 * self.upper)) - 1)
        return f"{number(digit * np.ceil(100 * self.upper / digit - 1e-9), 2)} %"

    def __str__(self) -> str:
        """Return failures and bound in words."""
        return f"{self.failures} of {self.flights}, at most {self.at_most}"


@dc.dataclass(frozen=True)
class Accepted:
    """What is accepted of a part that may be flown.

    limit: largest rate of failures [1]. confidence: of the bound [1].
    """

    limit: float = 0.01
    confidence: float = 0.95


DEFAULT = Accepted()


@dc.dataclass(frozen=True)
class Certificate:
    """Answer of `certify`.

    over: ranges; the first two make the map.
    part: (a, b) cells of the map that were chosen, and in which flights confirm.
    flights: a line for every flight: `stage`, `shares`, `refused`, `lost`, `grounded`, `peak` and
        `E_xy` [m], `failed`, and what was drawn.
    asked: number of flights that were asked for.
    """

    config: FlightConfig
    over: tuple[Range, ...]
    part: np.ndarray
    flights: pd.DataFrame
    confidence: float
    limit: float
    within: float
    asked: int

    @property
    def confirming(self) -> pd.DataFrame:
        """Flights that were drawn in the part after it was chosen."""
        return self.flights[self.flights["stage"] == CONFIRMING]

    def bound(self, of: str = "failed") -> Bound:
        """Return the bound of `failed`, of `lost` (refused flights among them), of `outside`,
        flights that left the corridor without a loss, or of `grounded`, whose payload was below the
        ground.
        """
        rows = self.confirming
        return Bound(rows[of].sum(), len(rows), self.confidence)

    @property
    def lacking(self) -> int | None:
        """How many more flights in the part, none of which fails, would show that it may be flown;
        None where none would, as it fails too often, or there is no part.
        """
        return self.bound().lacking(self.limit) if self.part.any() else None

    @property
    def answer(self) -> str:
        """Whether the part may be flown: `YES`, `NOT_SHOWN` with how many flights lack, or `NO`."""
        more = self.lacking
        if more is None:
            return NO
        return f"{NOT_SHOWN}: {more} more flights would" if more else YES

    @property
    def cells(self) -> np.ndarray:
        """Whether each cell of the map (a, b) may be flown, as of `answer`."""
        return np.where(self.part, self.answer, NO)

    def flown_of_asked(self) -> str:
        """Return how many of the flights that were asked for were flown, and why not all."""
        refused = self.flights.loc[self.flights["refused"] != "", "refused"]
        flown = len(self.flights) - len(refused)
        missing = self.asked - len(self.flights)
        text = f"{flown} of {self.asked} flights asked were flown"
        if len(refused):
            text += f"; {len(refused)} cannot be flown as drawn, the first: {refused.iloc[0]}"
        if missing:
            text += f"; for {missing} no part was left in which they fail seldom enough"
        return text

    def quantile(self, key: str, share: float) -> float:
        """Return the quantile of `peak` or `E_xy` in the part [m]; inf where lost flights reach
        it.
        """
        values = self.confirming[key].astype(float).fillna(np.inf)
        return values.quantile(share, interpolation="higher")

    def drivers(self) -> list[dict[str, Any]]:
        """Return what goes with the largest deviation, most of all first.

        A line has the name, its rank correlation over all flights (lost ones rank last) and the
        share that failed in its lowest, middle and highest third, and, of what was drawn from an
        interval or a posterior, what would tell it better.
        """
        rank = self.flights["peak"].astype(float).fillna(np.inf).rank()
        ranges = [one.name for one in self.over]
        lines = []
        for name in self.flights.columns.difference(KEYS):
            values = self.flights[name].dropna().astype(float)
            ranks = rank[values.index]
            if values.nunique() < 3 or ranks.nunique() < 2:
                continue
            rho = stats.spearmanr(values, ranks).statistic
            if abs(rho) * np.sqrt(len(values)) < NOTED:
                continue
            third = pd.qcut(values.rank(method="first"), 3, labels=False)
            shares = self.flights["failed"].groupby(third).mean()
            by = "" if name in ranges else self._teller(str(name))
            lines.append({"name": name, "rho": rho, "thirds": shares.tolist(), "told_by": by})
        return sorted(lines, key=lambda line: -abs(line["rho"]))[:DRIVERS]

    @staticmethod
    def _teller(name: str) -> str:
        """Return the manoeuvre that tells a drawn quantity."""
        effect = name.partition(".")[0]
        if effect in in_scenarios():
            return manoeuvre((effect,))
        ways = {part(q.field, *q.index): q.manoeuvre for q in QUANTITIES}
        return ways.get(name) or "a measurement of it"

    def allowed(self) -> list[tuple[str, str]]:
        """Return, for every cell of the first range, whether it may be flown, or what the second
        may be.
        """
        if not self.over:
            return []
        first, *others = self.over[:2]
        a, b = self.part.shape
        lines = []
        for i, row in enumerate(self.cells):
            cells = np.flatnonzero(row != NO)
            answer = self.answer if len(cells) else NO
            for second in others if len(cells) else ():
                ends = f"{second.at(cells[0] / b):.3g} to {second.at((cells[-1] + 1) / b):.3g}"
                answer = ends if answer == YES else f"{ends} {answer}"
            lines.append((f"{first.at(i / a):.3g} to {first.at((i + 1) / a):.3g}", answer))
        return lines

    def figure(self) -> Figure:
        """Return the map: flights, where they failed, and the cells that may be flown."""
        require(len(self.over) > 1, "certify: a map needs two ranges; name another --over.")
        y, x = self.over[:2]
        figure, axes = new_figure(1, 1, width=6.5, height=5.0)
        ax = axes[0, 0]
        a, b = self.part.shape
        edges = [one.at(np.arange(n + 1) / n) for one, n in ((x, b), (y, a))]
        colour = [0.72, 0.86, 0.95] if self.answer == YES else [0.9] * 3
        ax.pcolormesh(*edges, np.where((self.cells != NO)[..., None], colour, 1.0))
        shares = np.array(self.flights["shares"].tolist())
        flights = self.flights.assign(flown=~self.flights["failed"].astype(bool))
        for of, marker, size, color, label in (
            ("flown", ".", 8, "0.35", "flown"),
            ("outside", "^", 22, PALETTE[4], f"beyond {self.within:g} m"),
            ("grounded", "v", 22, PALETTE[2], "payload below ground"),
            ("lost", "x", 22, PALETTE[1], "lost, or not flyable"),
        ):
            which = shares[flights[of].to_numpy(bool)]
            if len(which):
                ax.scatter(x.at(which[:, 1]), y.at(which[:, 0]), size, color, marker, label=label)
        labels = [f"{one.name} [{UNITS.get(one.name, 'SI')}]" for one in (x, y)]
        ax.set(xlabel=labels[0], ylabel=labels[1], xlim=(x.low, x.high), ylim=(y.low, y.high))
        ax.set_title(
            f"{self.config.name} with {self.config.controller.name}. The part may be flown: "
            f"{self.answer}.\nIt fails in {self.bound()} ({100 * self.confidence:g} % sure)",
            fontsize=9,
        )
        figure.legend(loc="outside lower center", ncols=3)
        return figure

    def write_failed(self, folder: Path, seed: int) -> list[Path]:
        """Write drawn flights that failed as scenario files, and return their paths."""
        make_folder(folder)
        failed = self.flights[self.flights["failed"] & (self.flights["refused"] == "")]
        written = []
        for k, row in failed.sort_values("stage").head(MOST_KEPT).iterrows():
            flight, _ = drawn_flight(self.config, self.over, row["shares"], seed=(seed, k))
            content = scenario_content(dc.replace(flight, name=f"{flight.name}_{k}"))
            path = folder / f"{content['name']}.yaml"
            head = f"# Flight {k} of a certificate: np-drake fly {path.name} --seed {k}\n"
            write_text(path, head + yaml.safe_dump(content, sort_keys=False, allow_unicode=True))
            written.append(path)
        return written


def scenario_content(config: FlightConfig) -> dict[str, Any]:
    """Return what a scenario file of a flight holds, in SI."""
    return stated(plain(settings_of(dc.replace(config, scaled=False))))


KEYS = ("stage", "shares", "refused", "lost", "grounded", "outside", "failed", "peak", "E_xy")
UNITS = {"payload": "kg", "tether": "m", "speed": "m/s", "wind": "m/s"}


def flown(case: Case, *, config: FlightConfig, over: Sequence[Range], seed: int) -> dict:
    """Return what became of a drawn flight: why it was refused, whether it was lost or its payload
    below the ground, largest deviation and E_xy [m], None of one that was not flown to its end, and
    what was drawn.
    """
    lost = {"refused": "", "lost": True, "grounded": False, "peak": None, "E_xy": None}
    try:
        flight, drawn = drawn_flight(config, over, case["shares"], seed=(seed, case["flight"]))
    except ValueError as error:
        asked = {one.name: one.at(k) for one, k in zip(over, case["shares"], strict=True)}
        return lost | {"refused": str(error), "drawn": asked}
    try:
        result = fly(flight, seed=case["flight"])
    except LostVehicle:
        return lost | {"drawn": drawn}
    off = np.linalg.norm(result.flown - result.signals["p_ref"], axis=1)
    return {
        "refused": "",
        "lost": False,
        "grounded": result.below_ground is not None,
        "peak": off.max(),
        "E_xy": result.metrics()["E_xy"],
        "drawn": drawn,
    }


def chosen_part(failed: np.ndarray, flown_there: np.ndarray, rate: float) -> np.ndarray:
    """Return the largest part of a map that reaches from a corner and in which at most `rate` of
    the flights failed [1].

    With a cell, it holds all cells between that and the corner.

    Args:
        failed: (a, b) flights that failed in each cell.
        flown_there: (a, b) flights in each cell.
    """
    a, b = failed.shape
    widths = np.array(list(combinations_with_replacement(range(b, -1, -1), a)))
    best = (0, 0.0)
    part = np.zeros((a, b), bool)
    for flip in ((), (0,), (1,), (0, 1)):
        sums = [
            np.pad(np.cumsum(np.flip(of, flip), axis=1), ((0, 0), (1, 0)))
            for of in (failed, flown_there)
        ]
        k, n = (of[np.arange(a), widths].sum(axis=1) for of in sums)
        size = np.where(k <= rate * n, widths.sum(axis=1), 0)
        largest = int(np.lexsort((-k, size))[-1])
        worth = (int(size[largest]), -float(k[largest]))
        if worth > best:
            best = worth
            part = np.flip(np.arange(b) < widths[largest][:, None], flip)
    return part


def border(part: np.ndarray) -> np.ndarray:
    """Return the cells (k, 2) of a part beside cells that are not of it; all where there are
    none.
    """
    edge = part & ~ndimage.binary_erosion(part, border_value=1)
    return np.argwhere(edge if edge.any() else part)


@dc.dataclass
class _Draws:
    """Flights drawn from a scenario and ranges, with a line of each, as of
    `Certificate.flights`.
    """

    config: FlightConfig
    over: Sequence[Range]
    within: float  # radius of the corridor [m]
    run: Run
    lines: list[dict[str, Any]] = dc.field(default_factory=list)

    def fly(self, shares: np.ndarray, stage: str) -> list[bool]:
        """Fly one flight at each place (n, ranges) [1], and return which of them failed."""
        before = len(self.lines)
        cases = [{"flight": before + k, "shares": row} for k, row in enumerate(shares.tolist())]
        settings = {
            "scenario": settings_of(self.config),
            "over": [dc.astuple(one) for one in self.over],
            "seed": self.run.seed,
        }
        work = partial(flown, config=self.config, over=self.over, seed=self.run.seed)
        records = self.run.cases(stage, "flights", work, cases, config=settings)
        for case, result in zip(cases, every_result(records), strict=True):
            drawn = result.pop("drawn")
            outside = not result["lost"] and result["peak"] > self.within
            failed = result["lost"] or result["grounded"] or outside
            line = {"stage": stage, "shares": case["shares"], **result, "outside": outside}
            self.lines.append({**line, "failed": failed, **drawn})
        return [line["failed"] for line in self.lines[before:]]


def fly_draws(
    config: FlightConfig, over: Sequence[Range], flights: int, *, within: float, run: Run
) -> pd.DataFrame:
    """Return flights drawn evenly over ranges, as of `Certificate.flights`; arguments as of
    `certify`.
    """
    draws = _Draws(config, over, within, run)
    draws.fly(np.random.default_rng(run.seed).random((flights, len(over))), EVEN)
    return pd.DataFrame(draws.lines)


def certify(
    config: FlightConfig,
    over: Sequence[Range] = (),
    *,
    flights: int = 1000,
    within: float = np.inf,
    cells: int = 6,
    accepted: Accepted = DEFAULT,
    run: Run | None = None,
) -> Certificate:
    """Fly draws of a scenario and return where, and how surely, it may be flown.

    A flight fails that loses the vehicle, cannot be flown as drawn, lowers its payload below the
    ground, or is ever farther than `within` from its reference.

    Args:
        config: scenario, in whose vehicle's intervals and reality's posterior flights are drawn.
        over: ranges, of which the first two make the map.
        flights: in all; without a range none of them explores.
        within: radius of the corridor about the reference [m].
        cells: of the map along each range.
        accepted: largest rate of failures, and confidence of the bound.
        run: seed, workers, folder and progress; None: one process, silent, seed 0.
    Raises: ValueError: on a range that does not fit the scenario, or of which no draw can be flown;
        FailedRun: where a flight ends in an error.
    """
    run = run or Run()
    over = tuple(one.check() for one in over)
    limit = accepted.limit
    confidence = accepted.confidence
    shape = tuple(cells if k < len(over) else 1 for k in range(2))
    require(
        within > 0 and 0 < limit < 1 and 0 < confidence < 1 and 1 <= cells <= MOST_CELLS,
        f"certify: within [m] must be positive, limit and confidence between 0 and 1, cells 1 to "
        f"{MOST_CELLS}; got {within:g}, {limit:g}, {confidence:g}, {cells}.",
    )
    names = [one.name for one in over]
    require(len({*names}) == len(names), f"--over: ranges must differ; got {', '.join(names)}.")
    for one in over:  # a field that the scenario has not is no flight that failed
        with_value(config, one.name, one.low)
    fewest = FEWEST * math.prod(shape)
    require(
        flights >= (fewest if over else 1),
        f"--flights: must be at least {FEWEST} a cell of the map, {fewest}; got {flights}. Or take "
        "fewer --cells.",
    )
    explored = flights // 2 if over else 0
    confirming = flights - explored
    # Share of failures with which as many flights would still be certified [1].
    certified = (k for k in range(1, confirming) if Bound(k, confirming, confidence).upper <= limit)
    rate = max(certified, default=0) / confirming
    draws = _Draws(config, over, within, run)
    part = _explored(draws, shape, explored, flights, rate)
    return Certificate(
        config, over, part, pd.DataFrame(draws.lines), confidence, limit, within, flights
    )


def _explored(
    draws: _Draws, shape: tuple[int, ...], explored: int, flights: int, rate: float
) -> np.ndarray:
    """Fly `explored` flights over a map of cells, choose the part in which at most `rate` of them
    failed [1], and fly the rest of `flights` there; return the part.
    """
    failed = np.zeros(shape, int)
    count = np.zeros(shape, int)
    rng = np.random.default_rng(draws.run.seed)
    ranges = len(draws.over)

    def fly_in(cells: np.ndarray, stage: str) -> None:
        """Fly one flight in each of the cells (n, 2)."""
        shares = (cells + rng.random(cells.shape)) / shape
        more = rng.random((len(cells), max(ranges - 2, 0)))
        places = np.concatenate([shares[:, :ranges], more], axis=1)
        np.add.at(failed, tuple(cells.T), draws.fly(places, stage))
        np.add.at(count, tuple(cells.T), 1)

    first = explored // 2
    fly_in(rng.permutation(np.argwhere(count == 0))[np.arange(first) % count.size], EXPLORING)
    if draws.lines and all(line["refused"] for line in draws.lines):
        raise ValueError(f"certify: no draw can be flown. {draws.lines[0]['refused']}")
    for _ in range(ROUNDS if explored else 0):
        near = border(chosen_part(failed, count, rate))
        if len(near):
            fly_in(near[np.arange((explored - first) // ROUNDS) % len(near)], EXPLORING)
    part = chosen_part(failed, count, rate)
    inside = np.argwhere(part)
    if len(inside):
        fly_in(inside[rng.integers(len(inside), size=flights - len(draws.lines))], CONFIRMING)
    return part
