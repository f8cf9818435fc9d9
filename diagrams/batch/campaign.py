"""Resumable campaigns: cases that each end in a file and that fail one by one.

A case is plain data; the work is a function of it alone. Local processes or a Dask cluster give the
same results.
"""

import hashlib
import json
import resource
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from diagrams.batch.cluster import on_cluster
from diagrams.batch.failed_run import FailedRun, one_line
from diagrams.batch.processes import as_they_finish
from np_drake.files.atomic_file import plain, write_text
from np_drake.files.input_file import kept_json

SCHEMA = "np_drake.campaign/1"  # format of the file and its version
Case = dict[str, Any]
Record = dict[str, Any]


def run_campaign(
    work: Callable[[Case], dict],
    cases: Sequence[Case],
    *,
    config: dict,
    folder: Path | None = None,
    jobs: int = 1,
    scheduler: str = "",
    keep: Callable[[Case, dict], dict] = lambda case, result: result,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Record]:
    """Run all cases and return a record of each, in their order.

    Records do not depend on where the cases ran, `seconds` aside.

    A record is {"case", "result", "seconds"}, or {"case", "error": one line, "seconds"}. Results
    already in `folder` are reused; cases that failed, or whose file was cut off, are run again.
    `seconds`: processor time of the case [s].

    Args:
        work: case -> values of JSON's types; its NaN and infinities become None.
        folder: takes a file for every case; created where it is missing.
        keep: called in this process with every new result; writes what a result brings along, and
            returns what its record holds.
        on_progress: called with cases done, reused ones included, and all.
    Raises:
        ValueError: where cases repeat, or `folder` holds a file of the same case and another
            configuration or version: it is never overwritten.
        OSError: where `folder` cannot be written.
    """
    names = [case_file(case) for case in cases]
    if len(set(names)) < len(names):
        raise ValueError("campaign: cases must differ from each other.")
    head = _pure({"schema": SCHEMA, "version": version("np_drake"), "config": config})
    records = {} if folder is None else _finished(folder, names, head)
    left = [number for number in range(len(cases)) if number not in records]
    if records:
        on_progress(len(records), len(cases))
    for at, record in _run(work, [cases[number] for number in left], jobs, scheduler):
        number = left[at]
        if "result" in record:
            record = {**record, "result": _pure(keep(cases[number], record["result"]))}
        records[number] = {"case": _pure(cases[number]), **record}
        if folder is not None:
            write_text(
                folder / names[number], json.dumps({**head, **records[number]}, indent=1) + "\n"
            )
        on_progress(len(records), len(cases))
    return [records[number] for number in range(len(cases))]


def _finished(folder: Path, names: Sequence[str], head: dict) -> dict[int, Record]:
    """Return the records with a result in the folder, which is created where it is missing, by
    number.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found = {number: read_record(folder / name, head) for number, name in enumerate(names)}
    return {number: record for number, record in found.items() if record and "error" not in record}


def case_file(case: Case) -> str:
    """Return the name of the case's file, equal for equal content, whatever the order of its
    keys.
    """
    text = json.dumps(plain(case), sort_keys=True, allow_nan=False)
    return f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.json"


def read_record(path: Path, head: dict) -> Record | None:
    """Return the record of an earlier campaign; None where there is no file, or one that was cut
    off.
    Raises: ValueError: where the file is another campaign's, or none of a campaign.
    """
    content = kept_json(path)
    if content is None:
        return None
    theirs = content if isinstance(content, dict) else {}
    for key, mine in head.items():
        if theirs.get(key) != mine:
            raise ValueError(
                f"{path}: {_difference(key, theirs.get(key), mine)}; choose another folder."
            )
    if not {"case", "seconds"} <= theirs.keys() or case_file(theirs["case"]) != path.name:
        raise ValueError(
            f"{path}: must be the file of a case; its content is of none. Delete it to resume."
        )
    return {key: value for key, value in theirs.items() if key not in head}


def _difference(key: str, theirs: Any, mine: Any) -> str:
    """Return how a file and this campaign differ, by the first key that does."""
    if isinstance(theirs, dict) and isinstance(mine, dict):
        for name in sorted({*theirs, *mine}):
            if theirs.get(name) != mine.get(name):
                return _difference(f"{key}.{name}", theirs.get(name), mine.get(name))
    return f"its {key} is {json.dumps(theirs)}, this campaign's {json.dumps(mine)}"


def _run(
    work: Callable[[Case], dict], cases: list[Case], jobs: int, scheduler: str
) -> Iterator[tuple[int, Record]]:
    """Yield (number, {"result" or "error", "seconds"}) as cases finish, never in this process."""
    guarded = Guarded(work)
    if not cases:
        return
    outcomes = (
        on_cluster(guarded, cases, scheduler) if scheduler else as_they_finish(guarded, cases, jobs)
    )
    for number, outcome in outcomes:
        lost = isinstance(outcome, Exception)
        yield number, {"error": one_line(outcome), "seconds": None} if lost else _pure(outcome)


class Guarded:
    """Wrapper of `work` that never raises: an error becomes a line, so that none has to travel
    between processes.
    """

    def __init__(self, work: Callable[[Case], dict]):
        self.work, self.version = work, version("np_drake")

    def __call__(self, case: Case) -> Record:
        """Return {"result"} or {"error"}, and processor time "seconds" [s]."""
        start = _processor_time()
        try:
            self._require_same_version()
            record: Record = {"result": plain(self.work(case))}
            json.dumps(
                record, allow_nan=False
            )  # what JSON does not know is the error of this case alone
        except Exception as error:
            record = {"error": one_line(error)}
        return {**record, "seconds": _processor_time() - start}

    def _require_same_version(self) -> None:
        """Check that a worker of a cluster runs this campaign's np_drake.

        Raises: FailedRun: where it does not.
        """
        if (found := version("np_drake")) != self.version:
            raise FailedRun(
                f"{socket.gethostname()}: np_drake must be {self.version}; got {found}."
            )


def _processor_time() -> float:
    """Return what this process and its finished children have used [s]."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def _pure(content: Any) -> Any:
    """Return the value as it comes back from a file."""
    return json.loads(json.dumps(plain(content), allow_nan=False))
