"""Diagnoses every case of a challenge set, from its case folder alone."""

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from diagrams.batch.run import Case, Workers, require
from diagrams.challenge.answered_case import ANSWER_FILE
from diagrams.gap.drake_replay import DrakeReplay
from np_drake.diagnosis.diagnose import diagnose
from np_drake.files.file_access import kept_json, write_json
from np_drake.logs.opening import TRAIN, VEHICLE, open_case


def solve(
    cases: Path,
    answers: Path,
    *,
    workers: Workers | None = None,
    replay: bool = False,
    again: bool = False,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, Any]:
    """Write <answers>/<case>/diagnosis.json for every case folder; whole answers that are there
    stay.

    Args:
        cases: folder of case folders, under the same path on every worker.
        on_progress: called with the number of cases done and that of all.
    Returns: {"cases": all, "skipped": solved before, "solved": [{"case", "wall" [s]}], "failed":
        [{"case", "error": one line}]}, sorted by case.
    Raises: ValueError: if `cases` holds no case folder, or a file is in an answer's place; OSError:
        if an answer cannot be written.
    """
    folders = case_folders(cases)
    for out in (answers / folder.name for folder in folders):
        require(
            not out.exists() or out.is_dir(),
            f"{out}: must be a folder for the answer; it is a file. Move it away.",
            NotADirectoryError,
        )
    left = [f for f in folders if again or kept_json(answers / f.name / ANSWER_FILE) is None]

    def keep(case: Case, result: dict) -> dict:
        out = answers / case["case"]
        out.mkdir(parents=True, exist_ok=True)
        write_json(out / ANSWER_FILE, result["answer"])
        return {"wall": result["wall"]}

    records = (workers or Workers()).run(
        partial(solve_case, cases=cases.resolve(), replay=replay),
        [{"case": folder.name} for folder in left],
        config={"replay": replay},
        keep=keep,
        on_progress=on_progress,
    )
    return {
        "cases": len(folders),
        "skipped": len(folders) - len(left),
        "solved": [{**r["case"], **r["result"]} for r in records if "result" in r],
        "failed": [{**r["case"], "error": r["error"]} for r in records if "error" in r],
    }


def case_folders(cases: Path) -> list[Path]:
    """Return every folder with a vehicle file or a flight to fit, complete or not, sorted.

    Raises: ValueError: if there is none.
    """
    folders = [path for path in cases.iterdir() if path.is_dir() and not path.name.startswith(".")]
    found = sorted(f for f in folders if (f / VEHICLE).is_file() or any(f.glob(f"{TRAIN}*")))
    require(
        bool(found), f"{cases}: must hold case folders, each with {VEHICLE} and flights; got none."
    )
    return found


def solve_case(case: Case, *, cases: Path, replay: bool = False) -> dict:
    """Return of a case {"case": folder's name} {"answer": content of diagnosis.json, "wall" [s]};
    writes nothing.
    """
    start = time.perf_counter()
    answer = diagnose_folder(cases / case["case"], replay)
    return {"answer": answer, "wall": time.perf_counter() - start}


def diagnose_folder(folder: Path, replay: bool) -> dict[str, Any]:
    """Return the content of diagnosis.json: of the second answer where there is one, else of the
    first.

    A second answer knows half of every held-out flight that shows what training flights do not
    (`Diagnosis.refit`).
    """
    vehicle, train, held_out = open_case(folder)
    found = diagnose(vehicle, train, held_out, DrakeReplay(vehicle) if replay else None)
    return (found.refit or found).as_json()
