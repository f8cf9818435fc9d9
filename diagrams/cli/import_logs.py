"""`np-drake import`: flight logs of other formats become logs of ours, each with a sheet that says
what was done.
"""

import dataclasses as dc
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from diagrams.batch.run import make_folder
from diagrams.cli.output import progress, say
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from np_drake.logs.importing.import_log import Imported
    from np_drake.logs.importing.log_map import MapFile

SUFFIXES = (".csv", ".csv.gz", ".parquet")
Out = Annotated[
    Path | None, Option("--out", metavar="DIR", help="Folder for the logs and their sheets.")
]


@reports("import", seed=None, out=Out, folder=Path("out/import"), markdown=False)
def import_logs(
    run: Run,
    logs: Annotated[
        list[Path],
        Argument(
            metavar="LOG...",
            help="Logs: PX4 ULog, ROS bag or MCAP, Crazyflie micro-SD, ArduPilot DataFlash, "
            "Betaflight blackbox, "
            "Neural-Fly, CSV, Parquet.",
        ),
    ],
    log_map: Annotated[
        Path | None,
        Option(
            "--map",
            metavar="FILE",
            help="Map of columns and conventions (YAML), or a public data set: idsia, "
            "nanobench; default: by the log's "
            "own names.",
        ),
    ] = None,
    rate: Annotated[
        float,
        Option(
            metavar="HZ",
            min=0,
            max=20_000,
            help="Rate of the rows; 0: of the fastest signal that is used.",
        ),
    ] = 0.0,
    start: Annotated[
        float,
        Option(
            metavar="SECONDS",
            min=0,
            max=1e9,
            help="Of what is imported, from the log's first attitude on [s].",
        ),
    ] = 0.0,
    stop: Annotated[
        float, Option(metavar="SECONDS", min=0, max=1e9, help="Its end; 0: the log's [s].")
    ] = 0.0,
    adopt: Annotated[
        bool,
        Option("--adopt", help="Where a log fits other conventions than declared, take those."),
    ] = False,
    suffix: Annotated[
        str, Option(metavar="SUFFIX", help=f"Of the files that are written: {', '.join(SUFFIXES)}.")
    ] = ".csv",
) -> Report:
    """Import flight logs of other formats, with a sheet beside each: what was mapped, turned,
    aligned and left out.
    """
    from np_drake.logs.errors import LogError
    from np_drake.logs.importing.log_map import load_map_file

    if suffix not in SUFFIXES:
        raise ValueError(f"--suffix must be one of {', '.join(SUFFIXES)}; got {suffix!r}.")
    declared = None if log_map is None else load_map_file(log_map)
    how = {"rate": rate, "start": start, "stop": stop, "adopt": adopt}
    rows: list[tuple[Any, ...]] = []
    written: list[str] = []
    failures: list[str] = []
    left: list[str] = []
    with progress("importing", len(logs)) as advance:
        for number, path in enumerate(logs):
            try:
                found = _imported(
                    path, declared, how, lambda share, k=number: advance(k + share, "")
                )
                written += _write(found, run.folder, suffix, written)
            except (LogError, OSError) as error:
                failures.append(
                    str(error)
                    if isinstance(error, LogError)
                    else f"{path}: {error.strerror or error}."
                )
                continue
            left += [f"{path.name}: {note}" for note in _told(found)]
            rows += [_row(flight, found) for flight in found.flights]
            advance(number + 1, path.name)
    failure = None
    if failures:
        say(*failures[1:])
        more = f" ({len(failures)} of {len(logs)} logs failed)" if len(logs) > 1 else ""
        failure = LogError(failures[0] + more)
    return Report(
        [
            (
                "imported flights",
                ["flight", "s", "Hz", "input", "timing [ms]", "rows bridged or left out"],
                rows,
            )
        ]
        if rows
        else [],
        config={"logs": logs, "map": log_map, **how},
        metrics={"files": written, "failures": failures},
        summary=[*left, _written(len(written), run.folder)] if written else [],
        failure=failure,
    )


def _written(count: int, folder: Path) -> str:
    each = "1 flight" if count == 1 else f"{count} flights"
    return f"{each} written to {folder}, a sheet beside {'it' if count == 1 else 'each'}."


def _imported(path: Path, declared: "MapFile | None", how: dict[str, Any], tell: Any) -> "Imported":
    from np_drake.logs.importing.import_log import import_log

    return import_log(path, declared, **how, on_progress=tell)


def _told(found: "Imported") -> list[str]:
    """Return the notes that belong on the screen: what must be known, and what is left out."""
    return [
        note for note in found.sheet.content["notes"] if note in found.said or "left out" in note
    ]


def _write(found: "Imported", folder: Path, suffix: str, before: list[str]) -> list[str]:
    """Write the flights of one log and their sheets, and return the files.

    Args:
        before: files that this command has written of other logs.
    Raises: LogError: if a file is there already.
    """
    from np_drake.logs.errors import LogError
    from np_drake.logs.formats.log_file import write_log
    from np_drake.logs.import_sheet import sheet_path, write_sheet

    make_folder(folder)
    targets = [folder / f"{flight.name}{suffix}" for flight in found.flights]
    for path in (p for target in targets for p in (target, sheet_path(target))):
        if path.exists() and str(path) in before:
            raise LogError(
                f"{path}: must not be there; another log of this command has the same "
                f"name. Import it by itself, with "
                "another --out."
            )
        if path.exists():
            raise LogError(f"{path}: must not be there; remove it, or give another --out.")
    for flight, target in zip(found.flights, targets, strict=True):
        write_log(flight, target)
        write_sheet(dc.replace(found.sheet, start=flight.start), target)
    return [str(target) for target in targets]


def _row(flight: Any, found: "Imported") -> tuple[Any, ...]:
    gaps = found.sheet.content["gaps"]
    return (
        flight.name,
        float(flight.t[-1]),
        1 / flight.step,
        flight.input,
        1e3 * found.sheet.timing,
        "none" if gaps == "none" else gaps.split(";")[0].replace(" inside gaps left out", ""),
    )
