"""Run and report of a study: a function `run(run, ...) -> Report`, whose further parameters are its
options.

A study knows neither console nor files of its report. Called from Python it is silent:

    from diagrams.evidence.studies import tracking
    report = tracking.run(Run(seed=1000), seeds=3)

`np-drake reproduce` gives it a progress bar, prints the tables and writes what was asked for.

Its cases make a resumable campaign: each ends in a file and fails by itself, in processes of this
machine by joblib or of a Dask cluster (extra `cluster`). A process that dies costs only the case
that killed it. A case is plain data; the work is a function of it alone. Where it runs does not
change the results.
"""

import asyncio
import dataclasses as dc
import hashlib
import json
import os
import socket
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from np_drake.checks import require
from np_drake.files.file_access import kept_json, plain, require_writable, write_text


class FailedRun(RuntimeError):
    """Failure of a run, in one line for people: who failed, when, and why."""


def one_line(error: BaseException) -> str:
    """Return what went wrong, and where if the error was not expected."""
    text = " ".join(str(error).split()) or "no message"
    foreseen = (
        isinstance(error, FailedRun | ValueError | OSError)
        and type(error) is not UnicodeDecodeError
    )
    if foreseen or error.__traceback__ is None:
        return text
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {text} ({Path(last.filename).name}:{last.lineno})"


Case = dict[str, Any]
Record = dict[str, Any]


def case_file(case: Case, head: dict) -> str:
    """Return the name of the case's file: a digest of all that its result depends on."""
    text = json.dumps(plain([head, case]), sort_keys=True, allow_nan=False)
    return f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.json"


def _guarded(work: Callable[[Case], dict], mine: str, case: Case) -> Record:
    """Return {"result"} or {"error"}, and processor time "seconds" [s]: no error has to travel."""
    start = os.times()
    try:
        if (here := version("np_drake")) != mine:
            raise FailedRun(f"{socket.gethostname()}: np_drake must be {mine}; got {here}.")
        record: Record = {"result": plain(work(case))}
        json.dumps(record, allow_nan=False)  # what JSON does not know fails this case alone
    except Exception as error:
        record = {"error": one_line(error)}
    end = os.times()  # of this process and its finished children
    return {**record, "seconds": sum(end[:4]) - sum(start[:4])}


def _pure(content: Any) -> Any:
    """Return the value as it comes back from a file."""
    return json.loads(json.dumps(plain(content), allow_nan=False))


PATIENCE = 10.0  # until a scheduler that does not answer counts as unreachable [s]


def as_they_finish(
    work: Callable[[Any], Any], cases: Sequence[Any], jobs: int
) -> Iterator[tuple[int, Any]]:
    """Yield (number of the case, what `work` returns), in the order in which they finish.

    The work never runs in this process; what it raises ends all. When a process dies, the oldest
    cases run once more, each alone, and what dies again has a FailedRun in place of a value.
    """
    open_cases = dict(enumerate(cases))
    while open_cases:
        try:
            yield from _together(work, open_cases, jobs)
        except BrokenProcessPool:
            for suspect in list(open_cases)[: 2 * jobs]:  # more are not dispatched
                alone = {suspect: open_cases.pop(suspect)}
                try:
                    yield from _together(work, alone, 1)
                except BrokenProcessPool as error:
                    why = " ".join(str(error).split())
                    yield suspect, FailedRun(f"lost: its process died twice; {why}")


def _together(
    work: Callable[[Any], Any], open_cases: dict[int, Any], jobs: int
) -> Iterator[tuple[int, Any]]:
    """Yield what finishes, and take it from the open cases."""
    from joblib import Parallel, delayed, parallel_config  # takes a while: not where nothing is run

    # Of processes that have grown and are replaced between two cases, and of a campaign that ends.
    warnings.filterwarnings("ignore", module="joblib")
    tasks = [delayed(_numbered)(work, number, case) for number, case in open_cases.items()]
    with parallel_config("loky", inner_max_num_threads=1):
        parallel = Parallel(
            max(jobs, 2),  # of which one idles where jobs is 1: Parallel(1) would work here
            pre_dispatch=jobs,
            batch_size=1,
            max_nbytes=None,
            return_as="generator_unordered",
        )
    for number, value in parallel(tasks):
        del open_cases[number]
        yield number, value


def _numbered(work: Callable[[Any], Any], number: int, case: Any) -> tuple[int, Any]:
    return number, work(case)


def on_cluster(
    work: Callable[[Any], Any], cases: Sequence[Any], address: str
) -> Iterator[tuple[int, Any]]:
    """Yield as `as_they_finish`; Dask itself tries a case again whose worker dies.

    Raises: ValueError: as `connect`.
    """
    from distributed import KilledWorker, as_completed

    with connect(address) as client:
        futures = client.map(work, cases, pure=False)
        numbers = {future: number for number, future in enumerate(futures)}
        suspects = []
        for future in as_completed(futures, loop=client.loop):
            try:
                yield numbers[future], future.result()
            except KilledWorker:
                suspects.append(numbers[future])
        for number in suspects:  # alone, only the one that killed its workers does so again
            try:
                yield number, client.submit(work, cases[number], pure=False).result()
            except KilledWorker as error:
                yield number, FailedRun(f"lost: its workers died; {error}")


@contextmanager
def connect(address: str, patience: float = PATIENCE) -> Iterator[Any]:
    """Yield a `distributed.Client`.

    Raises: ValueError: without the extra, or where no scheduler answers within `patience` [s], or
        where a worker has several threads, of which all cases die with one.
    """
    require(
        find_spec("distributed") is not None,
        "--scheduler: its packages must be installed; pip install 'np_drake[cluster]'.",
    )
    from distributed import Client
    from distributed.comm import connect as reach

    async def answers() -> None:  # Dask's own limit does not hold for its handshake
        await (await asyncio.wait_for(reach(address, timeout=patience), patience)).close()

    try:
        asyncio.run(answers())  # first: a client that never connects leaves a thread
        connected = Client(address, timeout=patience, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:  # unreachable, or no address at all
        raise ValueError(f"--scheduler: no Dask scheduler answers at {address!r}.") from error
    with connected:
        require(
            max(connected.nthreads().values(), default=1) <= 1,
            "--scheduler: workers must have one thread each; start them with --nthreads 1.",
        )
        yield connected


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

    def run(
        self,
        work: Callable[[Case], dict],
        cases: Sequence[Case],
        *,
        config: dict,
        keep: Callable[[Case, dict], dict] = lambda case, result: result,
        on_progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> list[Record]:
        """Run all cases of a campaign and return a record of each, in their order.

        A record is {"case", "result", "seconds"}, or {"case", "error": one line, "seconds"}.
        Results already in `folder` are reused; cases that failed, or whose file was cut off, are
        run again, and so is all of another configuration or version. Records do not depend on where
        the cases ran, `seconds` of processor time aside.

        Args:
            work: case -> values of JSON's types; its NaN and infinities become None.
            keep: called in this process with every new result; returns what its record holds.
            on_progress: called with cases done, reused ones included, and all.
        Raises:
            ValueError: where cases repeat. OSError: where `folder` cannot be written.
        """
        head = _pure({"version": version("np_drake"), "config": config})
        folder = self.folder
        names = [case_file(case, head) for case in cases]
        require(len(set(names)) == len(names), "campaign: cases must differ from each other.")
        records: dict[int, Record] = {}
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            for number, name in enumerate(names):
                kept = kept_json(folder / name)
                if isinstance(kept, dict) and "result" in kept:
                    records[number] = kept
        remaining = [number for number in range(len(cases)) if number not in records]
        if records:
            on_progress(len(records), len(cases))
        guarded = partial(_guarded, work, head["version"])
        remaining_cases = [cases[number] for number in remaining]
        outcomes = (
            on_cluster(guarded, remaining_cases, self.scheduler)
            if self.scheduler and remaining  # else no cluster is asked for, nor a process
            else as_they_finish(guarded, remaining_cases, self.jobs)
        )
        for place, outcome in outcomes:
            number = remaining[place]
            case = cases[number]
            if isinstance(outcome, FailedRun):
                outcome = {"error": one_line(outcome), "seconds": None}
            elif "result" in outcome:
                outcome |= {"result": keep(case, _pure(outcome["result"]))}
            records[number] = _pure({"case": case, **outcome})
            if folder is not None:
                write_text(folder / names[number], json.dumps(records[number], indent=1) + "\n")
            on_progress(len(records), len(cases))
        in_order = [records[number] for number in range(len(cases))]
        self.finished.extend(in_order)
        return in_order

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
    bar: of (title, total), shows progress and yields `advance(done, text)`; `silent` shows none.
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

    @contextmanager
    def counting(self, title: str, what: str = "") -> Iterator[Callable[[int, int], None]]:
        """Show a progress bar and yield `on_progress(done, total)`, in `what` is counted."""
        with self.bar(title, 1.0) as advance:
            yield lambda done, total: advance(done / total, f"{done} of {total} {what}".rstrip())

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
    warnings: Sequence[str] = ()  # printed behind all of these, as a list
    # by file name in --out
    figures: Mapping[str, Callable[[], Any]] = dc.field(default_factory=dict)
    write: Callable[[Path], None] | None = None  # writes further files into the folder of --out
    failure: Exception | None = None  # raised when all is written and printed


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
    if records and all("error" in record for record in records):
        raise FailedRun(f"no case has a result; the first: {records[0]['error']}")
    return [record["result"] for record in records if "result" in record]


def every_result(records: Sequence[Record]) -> list[dict]:
    """Return the results of all cases, in their order; FailedRun where one has none."""
    if failed := failures(records):
        raise FailedRun(f"{failed[0]} ({len(failed)} of {len(records)} cases failed)")
    return [record["result"] for record in records]


def failures(records: Sequence[Record]) -> list[str]:
    """Return a line for every case without a result: what it was, and why."""
    failed = [record for record in records if "error" in record]
    return [f"{', '.join(map(str, r['case'].values()))}: {r['error']}" for r in failed]
