"""Options that several studies share: what is parsed, what `--help` says; and cells of tables."""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from diagrams.batch.run import Table, require
from np_drake.files.number_text import NOTHING

DEFAULT_SOLVER = "sqp"  # of every verb that flies
Solver = Annotated[str, Option("--solver", help="sqp | ipopt (MathematicalProgram, the reference)")]
Seeds = Annotated[
    int, Option("--seeds", min=1, max=10_000, help="Evaluation flights a row, of seeds seed + 1, …")
]
Only = Annotated[
    list[str] | None, Option("--only", help="Only rows of these names (nominal is always flown).")
]
Group = Annotated[
    list[str] | None,
    Option("--only", metavar="GROUP", help="Only cases of this group; repeatable."),
]
Reality = Annotated[
    Path | None,
    Option(
        "--reality",
        metavar="FILE",
        help=(
            "Fly in the simulator of this scenario: corrected.yaml of a diagnosis, or "
            "paper_vehicle."
        ),
    ),
]
Neurobem = Annotated[
    Path | None,
    Option(
        "--neurobem", metavar="DIR", envvar="NP_DRAKE_NEUROBEM", help="Folder of the real flights."
    ),
]
RealFlights = Annotated[
    Path | None,
    Argument(
        metavar="DIR",
        envvar="NP_DRAKE_REAL",
        show_envvar=False,
        help="Folder of the campaigns (imrc, idsia, neural_fly, …); or NP_DRAKE_REAL.",
    ),
]
Duration = Annotated[float, Option(min=10.0, max=3600.0, help="Of a flight, after the ramp [s].")]


REAL_FLIGHTS = "real flights as DIR or NP_DRAKE_REAL"
NEUROBEM_FLIGHTS = "NeuroBEM flights as --neurobem DIR or NP_DRAKE_NEUROBEM"


def required(study: str, folder: Path | None, flights: str) -> Path:
    """Return the folder of these flights; ValueError where the study is given none."""
    if folder is None:
        raise ValueError(f"{study}: give the folder of the {flights}.")
    return folder


def chosen(option: str, names: Collection[str] | None, known: Collection[str]) -> list[str]:
    """Return the known names that are asked for, all where none is; ValueError on another one."""
    unknown = ", ".join(sorted(set(names or ()) - set(known)))
    require(not unknown, f"{option}: must be of {'; '.join(known)}; got {unknown}.")
    return [name for name in known if not names or name in names]


Line = Mapping[str, Any]
Column = tuple[str, str | Callable[[Any], Any]]  # header; key of the line, or function of it


def tabulate(title: str, lines: Iterable[Any], columns: Iterable[Column]) -> Table:
    """Return title, header and a row for every line, from (header, key or function of a line)."""
    columns = list(columns)
    rows = [
        tuple(line[cell] if isinstance(cell, str) else cell(line) for _, cell in columns)
        for line in lines
    ]
    return title, [header for header, _ in columns], rows


def fixed(key: str, digits: int, *, factor: float = 1.0, unit: str = "") -> Callable[[Line], str]:
    """Return a cell of `factor` times the value with fixed digits; a dash where a line has none."""

    def cell(line: Line) -> str:
        value = line.get(key)
        return NOTHING if value is None else f"{factor * value:.{digits}f}{unit}"

    return cell


def percent(key: str, digits: int = 0) -> Callable[[Line], str]:
    """Return a cell in per cent of a share [1]; a dash where a line has none."""
    return fixed(key, digits, factor=100.0, unit=" %")


def spread(
    key: str, digits: int = 2, *, factor: float = 100.0, lost: str = "lost"
) -> Callable[[Line], str]:
    """Return a cell `value ± half of its 95 % interval`, in cm by default; the value alone where
    the interval is not a number, and a dash where a line has no value.
    """

    def cell(line: Line) -> str:
        if line[key] is None:
            return NOTHING
        value = factor * line[key]
        width = factor * line[f"{key}_ci95"]
        if math.isinf(value):
            return lost
        return f"{value:.{digits}f}" + ("" if math.isnan(width) else f" ± {width:.{digits}f}")

    return cell
