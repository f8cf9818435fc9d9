"""Diagnoses every case of a challenge set, from its case folder alone."""

import gc
import resource
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

from diagrams.batch.failed_run import one_line
from diagrams.batch.processes import as_they_finish
from diagrams.challenge.score.answered_case import ANSWER_FILE
from np_drake.atomic_file import write_json
from np_drake.diagnosis.diagnose import diagnose
from np_drake.input_file import kept_json
from np_drake.logs.case_folder import TRAIN, VEHICLE, open_case

COST = "cost.json"
KIBIBYTE = 1024  # [byte]
STATUS = Path("/proc/self/status")  # of Linux


def solve(
    cases: Path,
    answers: Path,
    *,
    jobs: int = 1,
    replay: bool = False,
    again: bool = False,
    on_progress: Callable[[int, str], None] | None = None,
) -> dict[str, Any]:
    """Writes <answers>/<case>/diagnosis.json for every case folder in `cases`; whole answers that are there stay.

    Args: replay: in Drake too.   again: solve what is solved.   on_progress: called with cases done and the last.
    Returns: {"cases": all, "skipped": solved before, "solved": [{"case", "wall" [s], "peak_memory" [byte]}],
        "failed": [{"case", "error": one line}]}, sorted by case.
    Raises: ValueError: if `cases` holds no case folder.
    """
    folders = case_folders(cases)
    left = [f for f in folders if again or kept_json(answers / f.name / ANSWER_FILE) is None]
    rows: list[dict[str, Any]] = []
    for row in solve_all(left, answers, jobs, replay):
        rows.append(row)
        if on_progress is not None:
            on_progress(len(rows), row["case"])
    rows.sort(key=lambda row: row["case"])
    return {
        "cases": len(folders),
        "skipped": len(folders) - len(left),
        "solved": [row for row in rows if "error" not in row],
        "failed": [row for row in rows if "error" in row],
    }


def case_folders(cases: Path) -> list[Path]:
    """Every folder with a vehicle file or a flight to fit, complete or not, sorted.

    Raises: ValueError: if there is none.
    """
    folders = [path for path in cases.iterdir() if path.is_dir() and not path.name.startswith(".")]
    found = sorted(f for f in folders if (f / VEHICLE).is_file() or any(f.glob(f"{TRAIN}*")))
    if not found:
        raise ValueError(f"{cases}: must hold case folders, each with {VEHICLE} and flights; got none.")
    return found


def solve_all(folders: Sequence[Path], answers: Path, jobs: int, replay: bool) -> Iterator[dict[str, Any]]:
    """A row a case, as they finish. Where a process dies, that case is lost."""
    work = partial(solve_case, answers=answers, replay=replay)
    for number, outcome in as_they_finish(work, folders, jobs=jobs):
        if outcome.error is None:
            yield outcome.value
        else:
            yield {"case": folders[number].name, "error": one_line(outcome.error)}


def solve_case(folder: Path, answers: Path, replay: bool) -> dict[str, Any]:
    """Diagnose one case and write its answer and cost into `answers`; a failure is in the row, never raised.

    The peak is of this process, which may have solved other cases before.
    """
    try:
        return _solve(folder, answers / folder.name, replay)
    except Exception as error:
        return {"case": folder.name, "error": one_line(error)}


def _solve(folder: Path, out: Path, replay: bool) -> dict[str, Any]:
    """The row of a case that is answered. Raises before the diagnosis where the answer has no place."""
    start = time.perf_counter()
    if out.exists() and not out.is_dir():
        raise NotADirectoryError(f"{out}: must be a folder for the answer; it is a file. Move it away.")
    answer = diagnose_folder(folder, replay)
    out.mkdir(parents=True, exist_ok=True)
    cost = {"wall": time.perf_counter() - start, "peak_memory": peak_memory(), "replay": replay}
    write_json(out / COST, cost)
    write_json(out / ANSWER_FILE, answer)
    return {"case": folder.name, **cost}


def peak_memory() -> int:
    """Most that this process has held [byte]; where the system says no more, its parent's until it was born too."""
    if STATUS.is_file():
        line = next(line for line in STATUS.read_text().splitlines() if line.startswith("VmHWM:"))
        return int(line.split()[1]) * KIBIBYTE
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * KIBIBYTE


def diagnose_folder(folder: Path, replay: bool) -> dict[str, Any]:
    """The content of diagnosis.json for a case folder: of the second answer where there is one, else of the first.

    A second answer knows half of every held-out flight that shows what training flights do not (`Diagnosis.refit`).
    """
    vehicle, train, held_out = open_case(folder)
    simulator = None
    if replay:
        from diagrams.gap.drake_replay import DrakeReplay

        simulator = DrakeReplay(vehicle)
    _keep_what_is_loaded()
    found = diagnose(vehicle, train, held_out, simulator)
    return (found.refit or found).as_json()


@cache
def _keep_what_is_loaded() -> None:
    """Modules are not gone through for garbage again and again while this process lives."""
    gc.freeze()
