"""What a diagnosis costs: whole processes on one core, from the start of the program to its answer."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from diagrams.batch.failed_run import FailedRun
from diagrams.batch.processes import ONE_THREAD
from diagrams.challenge.generate.make import make
from diagrams.challenge.solve import COST, case_folders
from np_drake.diagnosis.residuals.requirements import require_flights
from np_drake.logs.case_folder import open_case

LENGTHS = (20.0, 60.0, 200.0)  # of every flight [s]
MADE = {"simulator": "drake", "quality": "real", "cases": 1, "clean": 1}
LINK = "case"  # to the case, whatever it is called
PROGRAM = "from diagrams.cli.main import main; main()"


def cost_table(
    given: Sequence[Path],
    lengths: Sequence[float],
    *,
    seed: int,
    replay: bool,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[dict[str, Any]]:
    """A line a case, as `cost_of` gives it: of cases made with every length of flights [s], and of given folders.

    Raises: ValueError: where a folder is no case; FailedRun: where a case cannot be flown or diagnosed.
    """
    for case in given:
        size_of(case)  # asks before long work
    each = MADE["cases"] + MADE["clean"]  # type: ignore[operator]
    lines: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as scratch:
        for case in chain(_made(Path(scratch), lengths, seed), given):
            lines.append({**size_of(case), **cost_of(case, replay=replay)})
            on_progress(len(lines), each * len(lengths) + len(given))
    return lines


def _made(scratch: Path, lengths: Sequence[float], seed: int) -> Iterator[Path]:
    for seconds in lengths:
        out, truth = scratch / f"cases_{seconds:g}", scratch / f"truth_{seconds:g}"
        make(out, truth, seconds=seconds, seed=seed, **MADE)  # type: ignore[arg-type]
        yield from case_folders(out)


def size_of(case: Path) -> dict[str, Any]:
    """{"case", "seconds": of the longest flight, "rows": of all flights}.   Raises: ValueError: if it is no case."""
    _, train, held_out = open_case(case)
    require_flights(train, held_out)
    logs = [*train, *held_out]
    return {
        "case": case.resolve().name,
        "seconds": max(float(log.t[-1] - log.t[0]) for log in logs),
        "rows": sum(map(len, logs)),
    }


def cost_of(case: Path, *, replay: bool) -> dict[str, float]:
    """{"processor" [s], "wall" [s], "peak_memory" [byte]} of `challenge solve` on this case alone.

    Raises: FailedRun: where it ends without an answer.
    """
    with tempfile.TemporaryDirectory() as scratch:
        cases, answers = Path(scratch, "cases"), Path(scratch, "answers")
        cases.mkdir()
        (cases / LINK).symlink_to(case.resolve())
        arguments = ["challenge", "solve", cases, "--out", answers, *(["--replay"] if replay else [])]
        times = _times([sys.executable, "-c", PROGRAM, *map(str, arguments)], case.resolve().name)
        return {**times, "peak_memory": json.loads((answers / LINK / COST).read_text())["peak_memory"]}


def _times(command: Sequence[str], name: str) -> dict[str, float]:
    """Return processor and wall time of a process from its start to its end [s]."""
    start = time.perf_counter()
    with tempfile.TemporaryFile("w+") as said:
        environment = {**os.environ, **ONE_THREAD}
        process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=said)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        if process.returncode != 0:
            raise FailedRun(f"cost: {name} has no answer: {(said.read().splitlines() or ['it died.'])[-1]}")
    return {"processor": used.ru_utime + used.ru_stime, "wall": time.perf_counter() - start}
