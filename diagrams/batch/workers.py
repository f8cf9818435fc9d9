"""Where the cases of a verb run, and what they cost in the end."""

import dataclasses as dc
import statistics
from collections.abc import Callable, Sequence
from pathlib import Path

from diagrams.batch.campaign import Case, Record, run_campaign
from diagrams.batch.cluster import require_cluster
from diagrams.batch.failed_run import FailedRun

MINUTE, HOUR = 60.0, 3600.0  # [s]


@dc.dataclass(frozen=True)
class Workers:
    """Local processes or a Dask cluster, and the folder that cases are resumed from.

    jobs, scheduler: as of `run_campaign`.
    folder: takes a file for every case; None: nothing is kept. finished: records of all campaigns
        that ran here.
    """

    jobs: int = 1
    scheduler: str = ""
    folder: Path | None = None
    finished: list[Record] = dc.field(default_factory=list)

    def check(self) -> "Workers":
        """Check before long work that there are workers.

        Raises: ValueError: where no scheduler answers at the address.
        """
        if self.scheduler:
            require_cluster(self.scheduler)
        return self

    def run(
        self,
        work: Callable[[Case], dict],
        cases: Sequence[Case],
        *,
        config: dict,
        part: str = "",
        keep: Callable[[Case, dict], dict] = lambda case, result: result,
        on_progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> list[Record]:
        """Return the records of the cases; other arguments as of `run_campaign`.

        Args:
            part: folder inside the folder, for a campaign of another configuration.
            keep: takes every new result and returns what its record holds.
        """
        records = run_campaign(
            work,
            cases,
            config=config,
            folder=None if self.folder is None else self.folder / part,
            jobs=self.jobs,
            scheduler=self.scheduler,
            keep=keep,
            on_progress=on_progress,
        )
        self.finished.extend(records)
        return records

    def cost(self) -> list[str]:
        """Return the line on the processor time of all cases; none where there is no case."""
        seconds = [record["seconds"] for record in self.finished if record["seconds"] is not None]
        if not seconds:
            return []
        each = f"median {duration(statistics.median(seconds))}, most {duration(max(seconds))}"
        failed = sum("error" in record for record in self.finished)
        return [
            f"processor time of {len(seconds)} cases: {duration(sum(seconds))}; of a case: {each}"
            + (f"; cases that failed: {failed}" if failed else "")
        ]


def duration(seconds: float) -> str:
    """Return a time in the unit that suits it, in three digits."""
    for unit, size in (("h", HOUR), ("min", MINUTE)):
        if seconds >= 2 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.3g} s"


def require_result(records: Sequence[Record]) -> None:
    """Check that one case has a result.

    Raises: FailedRun: if none has.
    """
    if records and all("error" in record for record in records):
        raise FailedRun(f"no case has a result; the first: {records[0]['error']}")


def results(records: Sequence[Record]) -> list[dict]:
    """Return the results of the cases that have one, in their order.

    Raises: FailedRun: if none has.
    """
    require_result(records)
    return [record["result"] for record in records if "result" in record]


def every_result(records: Sequence[Record]) -> list[dict]:
    """Return the results of all cases, in their order.

    Raises: FailedRun: where one has none, of a table that cannot be without it; names the first.
    """
    if failed := failures(records):
        raise FailedRun(f"{failed[0]} ({len(failed)} of {len(records)} cases failed)")
    return [record["result"] for record in records]


def failures(records: Sequence[Record]) -> list[str]:
    """Return a line for every case without a result: what it was, and why."""
    return [
        f"{_named(record['case'])}: {record['error']}" for record in records if "error" in record
    ]


def _named(case: Case) -> str:
    """Return the values of a case that are no list; a lone number with its name."""
    known = {
        key: value
        for key, value in case.items()
        if isinstance(value, str | int | float) and value != ""
    }
    return ", ".join(
        value if isinstance(value, str) else f"{key} {value:g}" for key, value in known.items()
    )
