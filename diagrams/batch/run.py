"""Run and report of a study: a function `run(run, ...) -> Report`, whose further parameters are its
options.

A study knows neither console nor files of its report. Called from Python it is silent:

    from diagrams.studies import tracking
    report = tracking.run(Run(seed=1000), seeds=3)

`np-drake reproduce` gives it a progress bar, prints the tables and writes what was asked for.
"""

import dataclasses as dc
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from diagrams.batch.campaign import Case, Record, connect, run_campaign
from diagrams.batch.failed_run import FailedRun
from np_drake.files.atomic_file import require_writable

Advance = Callable[..., None]  # (done, text="")
Table = tuple[str, list[str], list[tuple]]  # title, header, rows


@dc.dataclass(frozen=True)
class Workers:
    """Local processes or a Dask cluster, and the folder that cases are resumed from.

    folder: takes a file for every case; None: nothing is kept. finished: records of all campaigns
        that ran here.
    """

    jobs: int = 1
    scheduler: str = ""
    folder: Path | None = None
    finished: list[Record] = dc.field(default_factory=list)

    def check(self) -> "Workers":
        """Check before long work that there are workers; ValueError where no scheduler answers."""
        if self.scheduler:
            with connect(self.scheduler):
                pass
        return self

    def run(self, work: Callable[[Case], dict], cases: Sequence[Case], **more: Any) -> list[Record]:
        """Return the records of the cases; further arguments as of `run_campaign`."""
        shared: dict[str, Any] = {
            "folder": self.folder,
            "jobs": self.jobs,
            "scheduler": self.scheduler,
        }
        records = run_campaign(work, cases, **shared, **more)
        self.finished.extend(records)
        return records

    def cost(self) -> list[str]:
        """Return the line on the processor time of all cases; none where there is no case."""
        seconds = [record["seconds"] for record in self.finished if record["seconds"] is not None]
        if not seconds:
            return []
        failed = sum("error" in record for record in self.finished)
        return [
            f"processor time of {len(seconds)} cases: {sum(seconds):.3g} s; "
            f"cases that failed: {failed}"
        ]


@contextmanager
def silent(description: str, total: float) -> Iterator[Advance]:
    """Yield an `advance(done, text)` that shows nothing."""
    yield lambda done, text="": None


@dc.dataclass(frozen=True)
class Run:
    """Seed, folders, workers and progress bar of one run.

    out: folder for figures and models; None: `scratch`.
    bar: shows progress, as `silent` does not.
    """

    seed: int = 0
    out: Path | None = None
    json: Path | None = None
    scratch: Path = dc.field(default_factory=lambda: Path(tempfile.mkdtemp(prefix="np_drake_")))
    workers: Workers = dc.field(default_factory=Workers)
    bar: Callable[[str, float], AbstractContextManager[Advance]] = silent

    @property
    def folder(self) -> Path:
        """Folder of `--out`, created on first use; else a scratch folder that ends with the run."""
        return make_folder(self.out) if self.out else self.scratch

    def progress(self, title: str, total: float = 1.0) -> AbstractContextManager[Advance]:
        """Show a progress bar up to `total` and yield `advance(done, text)`."""
        return self.bar(title, total)

    @contextmanager
    def counting(self, title: str, what: str = "") -> Iterator[Callable[[int, int], None]]:
        """Show a progress bar and yield `on_progress(done, total)`."""
        with self.bar(title, 1.0) as advance:
            yield counted(advance, what)

    def cases(
        self,
        title: str,
        what: str,
        work: Callable[[Case], dict],
        cases: Sequence[Case],
        **more: Any,
    ) -> list[Record]:
        """Return the records of the cases, worked on behind a progress bar; `more` as of
        `Workers.run`.
        """
        if not cases:
            return []
        with self.counting(title, what) as on_progress:
            return self.workers.run(work, cases, on_progress=on_progress, **more)


@dc.dataclass(frozen=True)
class Report:
    """Tables of a run, and what its files hold."""

    tables: Sequence[Table]
    config: dict[str, Any]
    metrics: dict[str, Any]  # of --json, behind its head
    lines: Sequence[str] = ()  # printed above the tables
    summary: Sequence[str] = ()  # printed below the tables, and in the Markdown file
    notes: Sequence[str] = ()  # printed below the tables only
    figures: Mapping[str, Callable[[], Any]] = dc.field(
        default_factory=dict
    )  # by file name in --out
    write: Callable[[Path], None] | None = None  # writes further files into the folder of --out
    failure: Exception | None = None  # raised when all is written and printed


def counted(advance: Advance, what: str = "") -> Callable[[int, int], None]:
    """Return an `on_progress(done, total)` that moves a bar of total 1."""
    return lambda done, total: advance(done / total, f"{done} of {total} {what}".rstrip())


def part_of(advance: Advance, before: float, share: float = 1.0) -> Advance:
    """Return an `advance(done, text)` of a part of the work: it begins at `before`, and its bar of
    total 1 takes a `share` of the whole.
    """
    return lambda done, text="": advance(before + share * done, text)


def make_folder(path: Path) -> Path:
    """Return the folder of `--out`, created where it is missing; OSError if it is not writable."""
    path.mkdir(parents=True, exist_ok=True)
    require_writable(path / "any")
    return path


def results(records: Sequence[Record]) -> list[dict]:
    """Return the results of the cases that have one, in their order; FailedRun if none has."""
    require_result(records)
    return [record["result"] for record in records if "result" in record]


def require_result(records: Sequence[Record]) -> None:
    """Check that one case has a result; FailedRun if none has."""
    if records and all("error" in record for record in records):
        raise FailedRun(f"no case has a result; the first: {records[0]['error']}")


def every_result(records: Sequence[Record]) -> list[dict]:
    """Return the results of all cases, in their order; FailedRun where one has none."""
    if failed := failures(records):
        raise FailedRun(f"{failed[0]} ({len(failed)} of {len(records)} cases failed)")
    return [record["result"] for record in records]


def failures(records: Sequence[Record]) -> list[str]:
    """Return a line for every case without a result: what it was, and why."""
    failed = [record for record in records if "error" in record]
    return [f"{', '.join(map(str, r['case'].values()))}: {r['error']}" for r in failed]
