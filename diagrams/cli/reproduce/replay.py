"""`np-drake reproduce replay`: real flights replayed open loop in the nominal and in the corrected simulator."""

import math
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from diagrams.batch.workers import failures, require_result
from diagrams.cli import options
from diagrams.cli.columns import MISSING, tabulate
from diagrams.cli.output import Table
from diagrams.cli.reproduce.real import require_logs
from diagrams.cli.runner import Report, Run, reports


@reports("reproduce", seed=None, out=options.OutOfCases, many=True)
def replay(
    run: Run,
    folder: Annotated[
        Path | None,
        Argument(
            metavar="DIR",
            envvar="NP_DRAKE_REAL",
            show_envvar=False,
            help="Folder with imrc/bare, imrc/payload and neural_fly; or NP_DRAKE_REAL.",
        ),
    ] = None,
    neurobem: options.Neurobem = None,
    only: Annotated[
        list[str] | None, Option("--only", metavar="GROUP", help="Only cases of this group; repeatable.")
    ] = None,
) -> Report:
    """Real flights replayed open loop, nominal and corrected simulator. --out DIR: cases to resume from."""
    if folder is None:
        raise ValueError("replay: give the folder of the real flights as DIR or NP_DRAKE_REAL.")
    from diagrams.challenge.real import replay as study
    from diagrams.challenge.real.cases import make_cases

    chosen = make_cases(folder, neurobem, only or ())
    require_logs(chosen)
    cases = [{"group": case.group, "name": case.name} for case in chosen]
    config: dict[str, Any] = {"folder": folder.name, "neurobem": neurobem and neurobem.name, "only": only}
    work = study.RealReplay(folder.resolve(), neurobem and neurobem.resolve())
    records = run.cases("replaying", "cases", work, cases, config=config)
    require_result(records)
    results = [{**r["case"], **r["result"]} for r in records if "result" in r]
    lines = study.lines(results)
    return Report(
        [printed(lines)],
        config=config,
        metrics={"table": lines, "runs": records},
        notes=failures(records),
    )


def printed(lines: list[dict]) -> Table:
    """Return the table: medians over the cases, nominal → corrected."""

    def change(before: str, after: str, factor: float = 1.0):
        def cell(line: dict) -> str:
            values = [factor * line[name] for name in (before, after)]
            return " → ".join(f"{v:.3g}" if math.isfinite(v) else MISSING for v in values)

        return cell

    columns = (
        ("flights", "group"),
        ("cases", "cases"),
        ("0.25 s: position [cm]", change("early nominal", "early corrected", 100.0)),
        ("1 s: position [cm]", change("position nominal", "position corrected", 100.0)),
        ("velocity [cm/s]", change("velocity nominal", "velocity corrected", 100.0)),
        ("attitude [deg]", change("attitude nominal", "attitude corrected")),
        ("better", lambda line: f"{line['better']} of {line['replayed']}"),
        ("payload [cm]", change("below", "swinging", 100.0)),
    )
    return tabulate(
        "real flights, open loop: nominal → corrected simulator; medians over the cases", lines, columns
    )
