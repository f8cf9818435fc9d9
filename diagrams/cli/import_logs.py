"""`np-drake import`: flight logs of other formats become logs of ours, each with a sheet that says
what was done.
"""

import dataclasses as dc
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from diagrams.batch.run import part_of, require
from diagrams.cli.verb import LogMap, Report, Run, progress, reports, say
from np_drake.files.number_text import grouped
from np_drake.logs.errors import LogError
from np_drake.logs.formats.log_file import SUFFIXES, write_log
from np_drake.logs.import_sheet import sheet_path, write_sheet
from np_drake.logs.importing.import_log import Imported, import_log
from np_drake.logs.importing.log_map import load_map_file


@reports(
    "import",
    seed=None,
    out="Folder for the logs and their sheets.",
    folder=Path("out/import"),
    markdown=False,
)
def import_logs(
    run: Run,
    logs: Annotated[
        list[Path],
        Argument(
            metavar="LOG...",
            help="Logs: PX4 ULog, ROS bag or MCAP, Crazyflie micro-SD, ArduPilot DataFlash, "
            "MAVLink .tlog, Betaflight and INAV blackbox, "
            "Neural-Fly, CSV, Parquet.",
        ),
    ],
    log_map: LogMap = None,
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
    require(suffix in SUFFIXES, f"--suffix must be one of {', '.join(SUFFIXES)}; got {suffix!r}.")
    declared = None if log_map is None else load_map_file(log_map)
    how = {"rate": rate, "start": start, "stop": stop, "adopt": adopt}
    rows = list[tuple]()
    written = list[str]()
    failures = list[str]()
    remarks = list[str]()
    with progress("importing", len(logs)) as advance:
        for number, path in enumerate(logs):
            try:
                imported = import_log(
                    path,
                    declared,
                    **how,  # type: ignore[arg-type]
                    on_progress=part_of(advance, number),
                )
                targets = _targets(imported, run.folder, suffix, written)
            except (LogError, OSError) as error:
                reason = getattr(error, "strerror", None)
                failures.append(f"{path}: {reason}." if reason else str(error))
                continue
            for flight, target in zip(imported.flights, targets, strict=True):
                write_log(flight, target)
                write_sheet(dc.replace(imported.sheet, start=flight.start), target)
                written.append(str(target))
            remarks += [f"{path.name}: {line}" for line in imported.shown]
            gaps = (
                imported.sheet.content["gaps"]
                .split(";")[0]
                .replace(" inside gaps bridged or left out", "")
            )
            timing = 1e3 * imported.sheet.timing
            rows += [
                (log.name, log.t[-1], 1 / log.step, log.input, timing, gaps)
                for log in imported.flights
            ]
            advance(number + 1, path.name)
    failure = None
    if failures:
        say(*failures[1:])
        more = f" ({len(failures)} of {len(logs)} logs failed)" if len(logs) > 1 else ""
        failure = LogError(failures[0] + more)
    header = ["flight", "s", "Hz", "input", "timing [ms]", "rows bridged or left out"]
    flights = f"{len(written)} flight{'s' if len(written) != 1 else ''}"
    return Report(
        [("imported flights", header, rows)] if rows else [],
        config={"logs": logs, "map": log_map, **how},
        metrics={"files": written, "failures": failures},
        summary=[f"{flights} written to {run.folder}, a sheet beside each."] if rows else [],
        warnings=grouped(remarks, [path.name for path in logs]),
        failure=failure,
    )


def _targets(imported: Imported, folder: Path, suffix: str, before: list[str]) -> list[Path]:
    """Return the files of the flights of one log; `before` are those of other logs.

    Raises: LogError: if a file is there already.
    """
    targets = [folder / f"{flight.name}{suffix}" for flight in imported.flights]
    for path in (p for target in targets for p in (target, sheet_path(target))):
        if path.exists():
            twice = "another log of this command has the same name. Import it by itself, with"
            remedy = twice if str(path) in before else "remove it, or give"
            raise LogError(f"{path}: must not be there; {remedy} another --out.")
    return targets
