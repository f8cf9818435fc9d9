"""Study `real`: the diagnosis, or answers of any tool, on real flights whose cause is known."""

import dataclasses as dc
import hashlib
from pathlib import Path
from typing import Annotated, Any

from typer import Option

from diagrams.batch.failed_run import FailedRun
from diagrams.batch.run import Report, Run, failures
from diagrams.challenge.real.answers import require_answers, write_answers
from diagrams.challenge.real.calibration import bins, calibration_figure
from diagrams.challenge.real.cases import RULE, OfNamedCase, make_cases
from diagrams.challenge.real.flights import require_logs
from diagrams.challenge.real.score import BASELINES, THIS, Scoring
from diagrams.challenge.real.summary import judged_names, methods_of
from diagrams.challenge.real.tables import tables
from diagrams.challenge.score.answered_case import ANSWER_FILE
from diagrams.studies.options import RealFlightOptions

ANSWERS = "answers"  # folder in that of --out


@dc.dataclass(frozen=True)
class Options(RealFlightOptions):
    """Options of the study."""

    answers: Annotated[
        Path | None,
        Option(
            "--answers",
            metavar="DIR",
            help=f"Score DIR/<group>/<case>/{ANSWER_FILE} of any tool; nothing is diagnosed.",
        ),
    ] = None
    beside: Annotated[
        list[str] | None,
        Option(
            "--beside",
            metavar="NAME=DIR",
            help="A row of answers made by another version; repeatable.",
        ),
    ] = None

    def others(self) -> dict[str, Path]:
        """Return the folders of `--beside` by name.

        Raises: ValueError: if one is no NAME=DIR, or the name is taken.
        """
        found: dict[str, Path] = {}
        for text in self.beside or ():
            name, equals, folder = text.partition("=")
            if not (name and equals and folder) or name in (THIS, *BASELINES, *found):
                taken = ", ".join((THIS, *BASELINES))
                raise ValueError(
                    f"--beside: must be NAME=DIR, each NAME once and none of {taken}; got {text!r}."
                )
            found[name] = Path(folder)
        return found


def run(run: Run, options: Options) -> Report:
    """The diagnosis on real flights with known causes, beside least squares and answers of other
    versions.
    """
    folder, beside = options.given("real"), options.others()
    cases = make_cases(folder, options.neurobem, options.only or ())
    given = {**({} if options.answers is None else {"--answers": options.answers}), **beside}
    notes = [line for name, own in given.items() for line in require_answers(name, own, cases)]
    require_logs(run, cases)
    config: dict[str, Any] = {"folder": folder, "neurobem": options.neurobem, "only": options.only}
    if given:
        config["answers"] = {name: _digest(own) for name, own in given.items()}
    absolute = {name: own.resolve() for name, own in beside.items()}
    work = Scoring(options.answers and options.answers.resolve(), absolute)
    scoring = OfNamedCase(work, folder.resolve(), options.neurobem and options.neurobem.resolve())
    named = [{"group": case.group, "name": case.name} for case in cases]
    title = "diagnosing" if options.answers is None else "scoring"
    finished = run.cases(title, "cases", scoring, named, config=config)
    failed = failures(finished)
    records = [dict(r["result"]) for r in finished if "result" in r]
    folders = {(case.group, case.name): case.folder for case in cases}
    made = {
        folders[r["group"], r["case"]]: answer
        for r in records
        if (answer := r.pop("answer", None)) is not None
    }
    series = {name: judged_names(records, name) for name in methods_of(records, "naming")}
    return Report(
        tables(records),
        config={**config, "cases": [f"{case.group}: {case.name}" for case in cases]},
        metrics={
            "table": records,
            "calibration": {n: bins(p) for n, p in series.items()},
            "failures": failed,
        },
        summary=[f"{len(records)} cases, by this rule:", *RULE],
        notes=notes,
        figures={"calibration.png": lambda: calibration_figure(series)}
        if any(series.values())
        else {},
        write=(lambda out: write_answers(out / ANSWERS, made)) if made else None,
        failure=FailedRun(f"{failed[0]} ({len(failed)} of {len(cases)} cases failed)")
        if failed
        else None,
    )


def _digest(folder: Path) -> str:
    """Return the SHA-256 of all answers in a folder, so that others are not taken for them."""
    total = hashlib.sha256()
    for file in sorted(folder.rglob(ANSWER_FILE)):
        total.update(str(file.relative_to(folder)).encode() + file.read_bytes())
    return total.hexdigest()
