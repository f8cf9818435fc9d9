"""Answers of this and of another version of the diagnosis to the same flights, each in a process of its own."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import np_drake
from diagrams.batch.failed_run import FailedRun
from diagrams.batch.processes import ONE_THREAD
from diagrams.challenge.real import worker
from diagrams.challenge.real.cases import Case
from diagrams.challenge.real.flights import open_case
from np_drake.files.input_file import read_json

HERE = Path(np_drake.__file__).resolve().parents[1]  # the folder that holds this version of the packages


def require_checkout(checkout: Path) -> Path:
    """Return the folder of another checkout of this repository.

    Raises: ValueError: if it holds no such package.
    """
    if not (checkout / "np_drake" / "diagnosis" / "diagnose.py").is_file():
        raise ValueError(
            f"--beside {checkout}: must be a checkout of this repository, with np_drake/diagnosis/diagnose.py."
        )
    return checkout.resolve()


def answers(case: Case, checkouts: list[Path]) -> list[dict[str, Any]]:
    """Return the content of `diagnosis.json` of every checkout, one after the other on one core.

    Raises: LogError, OSError: if a flight cannot be used; FailedRun: if a diagnosis fails, in one line.
    """
    with tempfile.TemporaryDirectory() as scratch:
        flights = Path(scratch) / "flights.npz"
        worker.pack(flights, *open_case(case))
        return [_answer(case, checkout, flights) for checkout in checkouts]


def _answer(case: Case, checkout: Path, flights: Path) -> dict[str, Any]:
    out = flights.with_name("answer.json")
    out.unlink(missing_ok=True)
    done = subprocess.run(
        [sys.executable, "-P", worker.__file__, str(flights), str(out), *(["second"] * case.second)],
        env={**os.environ, **ONE_THREAD, "PYTHONPATH": str(checkout)},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode or not out.is_file():
        last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        raise FailedRun(f"{case.group} {case.name}: the diagnosis of {checkout} failed: {last}")
    found = read_json(out)
    if Path(found["np_drake"]).resolve() != checkout.resolve():
        raise FailedRun(f"{checkout}: its np_drake was not the one that answered; got {found['np_drake']}.")
    return found
