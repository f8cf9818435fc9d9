"""Clean flights whose logs keep every second, third or fourth row: no cause of timing may be found."""

import dataclasses as dc
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.batch.workers import Workers, results
from diagrams.challenge.generate.case import FILES, CaseDraw, draw_case
from diagrams.challenge.generate.make import fly_case
from diagrams.challenge.generate.sensor_quality import rows_of
from diagrams.challenge.generate.vehicles import vehicle_file
from np_drake.diagnosis.diagnose import diagnose
from np_drake.logs.case_folder import VEHICLE, open_case
from np_drake.logs.formats.log_file import write_log

TIMING = ("clock_offset", "command_delay", "motor_lag")
KEPT = (2, 3, 4)  # every k-th row [1]
SETTINGS = (("drake", "clean"), ("rotorpy", "real"), ("drake", "real"), ("rotorpy", "clean"))
SECONDS = 12.0  # of every flight [s]
Progress = Callable[[int, int], None]


@dc.dataclass(frozen=True)
class ThinnedCase:
    """Answers to one case: as asked, and with the detection of the commands' timing switched off."""

    index: int
    simulator: str
    quality: str
    kept: int
    verdict: tuple[str, ...]
    naive: tuple[str, ...]

    def row(self) -> dict[str, Any]:
        """Return the case as JSON."""
        return dc.asdict(self)


def answer_thinned(
    flights: int,
    *,
    seed: int,
    seconds: float = SECONDS,
    workers: Workers | None = None,
    on_progress: Progress = lambda done, total: None,
) -> list[ThinnedCase]:
    """Fly, thin and diagnose at least so many clean flights, three to a case.

    Cases without a result are missing; the records of `workers` say why.
    Raises: FailedRun: if no case has a result.
    """
    cases = [{"index": index, "seed": seed, "seconds": seconds} for index in range(-(-flights // len(FILES)))]
    records = (workers or Workers()).run(
        answer, cases, config={"part": "thinned"}, part="thinned", on_progress=on_progress
    )
    return [
        ThinnedCase(**row | {name: tuple(row[name]) for name in ("verdict", "naive")})
        for row in results(records)
    ]


def answer(work: dict[str, Any]) -> dict[str, Any]:
    """Return the answers to the case {"index", "seed", "seconds"} as JSON."""
    index, seed, seconds = work["index"], work["seed"], work["seconds"]
    simulator, quality = SETTINGS[index % len(SETTINGS)]
    kept = KEPT[index % len(KEPT)]
    case = draw_case(CaseDraw(index, "clean"), quality=quality, seed=seed, seconds=seconds)
    _, noisy = fly_case(case, simulator)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        unstated = dc.replace(case.vehicle, command_timing="unknown")
        (folder / VEHICLE).write_text(vehicle_file(unstated), encoding="utf-8")
        for file, log in noisy.items():
            write_log(rows_of(log, np.arange(0, len(log), kept)), folder / file)
        vehicle, train, held_out = open_case(folder)
    found = diagnose(vehicle, train, held_out)
    naive = diagnose(dc.replace(vehicle, command_timing="held"), train, held_out)
    return ThinnedCase(index, simulator, quality, kept, found.verdict, naive.verdict).row()


def count(cases: list[ThinnedCase], answered: str) -> tuple[int, int]:
    """Return in how many cases an answer (`verdict`, `naive`) names a cause of timing, and any other cause."""
    timed = sum(bool(set(getattr(case, answered)) & set(TIMING)) for case in cases)
    other = sum(bool(set(getattr(case, answered)) - set(TIMING)) for case in cases)
    return timed, other
