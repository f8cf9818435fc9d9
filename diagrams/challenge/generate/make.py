"""Makes a challenge set: case folders here, their truth elsewhere."""

import dataclasses as dc
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from joblib import Parallel, delayed

from diagrams.batch.failed_run import FailedRun
from diagrams.challenge.generate.case import FILES, NOISE, Case, CaseDraw, case_name, draw_case
from diagrams.challenge.generate.composition import TWO_AT_ONCE, compose
from diagrams.challenge.generate.ground_truth import (
    FlightPair,
    equivalent_library_effects,
    flight_pairs,
    truth,
)
from diagrams.challenge.generate.logged_input import as_logged, per_row, with_input
from diagrams.challenge.generate.sensor_quality import kept_rows, rows_of, with_sensor_noise
from diagrams.challenge.generate.vehicles import vehicle_file
from diagrams.challenge.simulators.rotorpy import optional_import
from np_drake.atomic_file import write_json, write_text
from np_drake.logs.flight_log import FlightLog
from np_drake.logs.import_sheet import write_sheet
from np_drake.logs.log_file import write_log

ATTEMPTS = 12  # draws of one case before the set fails
QUALITIES = ("clean", "real", "wild")


def simulators() -> dict[str, Callable]:
    """Return simulators by name: fly(vehicle, plan, effects, *, t, onset, background) -> the exact FlightLog."""
    from diagrams.challenge.simulators.drake.simulator import fly

    return {"drake": fly, "rotorpy": optional_import.fly}


def make(
    out: Path,
    truth: Path,
    *,
    simulator: str = "drake",
    quality: str = "clean",
    cases: int = 44,
    clean: int = 20,
    seconds: float = 20.0,
    seed: int = 0,
    unseen: bool = False,
    jobs: int = 1,
    on_progress: Callable[[int], None] | None = None,
) -> dict:
    """Writes `cases` + `clean` case folders into `out` and as many truths into `truth`.

    unseen: all `cases` have an out-of-library effect that is held out from other sets.
    Returns: {"written", "kinds": {kind: count}, "redrawn": how many draws were lost on the way, "lost": which}.
    Raises: ValueError: on impossible arguments; FailedRun: where a case cannot be flown in any draw.
    """
    check_request(out, truth, simulator=simulator, quality=quality, seconds=seconds, cases=cases + clean)
    require_no_other_set(out, truth, seed=seed, cases=cases + clean)
    for folder in (out, truth):
        folder.mkdir(parents=True, exist_ok=True)
    two = TWO_AT_ONCE if quality == "wild" else 0.0
    draws = compose(cases, clean, seed, unseen=unseen, two=two)
    options = {"simulator": simulator, "quality": quality, "seconds": seconds, "seed": seed}
    work = (delayed(make_case)(draw, out, truth, **options) for draw in draws)
    lost: dict[str, int] = {}
    attempts = Parallel(n_jobs=jobs, return_as="generator")(work)
    for done, (draw, count) in enumerate(zip(draws, attempts, strict=True), start=1):
        if count:
            name = " + ".join(draw.names) or draw.kind
            lost[name] = lost.get(name, 0) + count
        if on_progress is not None:
            on_progress(done)
    kinds = {kind: sum(draw.kind == kind for draw in draws) for kind in sorted({d.kind for d in draws})}
    return {"written": len(draws), "kinds": kinds, "redrawn": sum(lost.values()), "lost": lost}


def make_case(
    draw: CaseDraw, out: Path, truth: Path, *, simulator: str, quality: str, seconds: float, seed: int
) -> int:
    """Draws a case until its vehicle is not lost and no library effect explains it, and writes it.

    Returns: how many draws were lost.
    """
    last: FailedRun | None = None
    for attempt in range(ATTEMPTS):
        case = draw_case(dc.replace(draw, attempt=attempt), quality=quality, seed=seed, seconds=seconds)
        try:
            exact, noisy = fly_case(case, simulator)
            flights = flight_pairs(case, exact, noisy)
            require_no_library_equivalent(case, flights)
        except FailedRun as error:
            last = error
            continue
        write_case(case, simulator, noisy, flights, out, truth)
        return attempt
    raise FailedRun(f"make: no draw of {draw.names} could be flown; the last: {last}")


def fly_case(case: Case, simulator: str) -> tuple[dict[str, FlightLog], dict[str, FlightLog]]:
    """Return the exact and the noisy logs of a case by file, with the same rows; the noisy hold the case's input."""
    fly, exact, noisy = simulators()[simulator], {}, {}
    background = case.quality.background(case.vehicle)
    for flight, (file, plan) in enumerate(case.plans.items()):
        every = fly(
            case.vehicle,
            plan,
            case.effects_of(file),
            t=case.input.instants(case.instants(file)),
            onset=case.onset[file],
            background=background,
        )
        every.name = file.removesuffix(".csv")
        exact[file], noisy[file] = as_measured(case, every, flight)
    return exact, noisy


def as_measured(case: Case, every: FlightLog, flight: int) -> tuple[FlightLog, FlightLog]:
    """Return the exact and the noisy log of flight number `flight`, with the same rows.

    Args: every: exact log with a row a command.
    """
    rng = case.stream(NOISE, flight)
    log = per_row(every, case.input.finer)
    rows = kept_rows(rng, case.quality, len(log))
    sensed = with_sensor_noise(log, case.vehicle, case.quality, rng)
    u = as_logged(every, case.input.semantics, case.input.finer, case.input.late).u
    logged = with_input(dc.replace(sensed, u=u), case.vehicle, case.input.kind)
    return rows_of(log, rows), rows_of(logged, rows)


def require_no_library_equivalent(case: Case, flights: dict[str, FlightPair]) -> None:
    """Raise FailedRun where a library effect explains what an out-of-library effect leaves in the flights."""
    if case.draw.kind == "foreign" and (names := equivalent_library_effects(case, flights)):
        raise FailedRun(f"make: {' with '.join(case.draw.names)} must be no {names[0]} where it is flown.")


def write_case(
    case: Case,
    simulator: str,
    noisy: dict[str, FlightLog],
    flights: dict[str, FlightPair],
    out: Path,
    truth_folder: Path,
) -> None:
    """Write both folders, each whole or not at all."""
    with whole_folder(truth_folder / case.name) as folder:
        write_json(folder / "truth.json", truth(case, simulator, flights))
    with whole_folder(out / case.name) as folder:
        write_text(folder / "vehicle.yaml", vehicle_file(case.vehicle))
        for file in FILES:
            write_log(noisy[file], folder / file)
            if (sheet := case.input.sheet(noisy[file].step)) is not None:
                write_sheet(sheet, folder / file)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Yield a temporary folder beside `path` that takes its name at the end; an older folder gives way."""
    temporary = Path(tempfile.mkdtemp(prefix=".", dir=path.parent))
    try:
        yield temporary
        temporary.chmod(0o755)
        if path.exists():
            shutil.rmtree(path)
        os.replace(temporary, path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def require_no_other_set(out: Path, truth: Path, *, seed: int, cases: int) -> None:
    """Raise ValueError where a folder holds what is not of this set: two sets could not be told apart there."""
    own = {case_name(seed, index) for index in range(cases)}
    for folder in (out, truth):
        others = sorted({path.name for path in folder.glob("[!.]*")} - own) if folder.is_dir() else []
        if others:
            raise ValueError(f"make: {folder} holds another set, or {others[0]}; give an empty folder.")


def check_request(
    out: Path, truth: Path, *, simulator: str, quality: str, seconds: float, cases: int
) -> None:
    """Raise ValueError where `make` would, before any work."""
    here, there = out.resolve(), truth.resolve()
    if here == there or here in there.parents or there in here.parents:
        raise ValueError(f"make: neither of cases and truth may lie in the other; got {out} and {truth}.")
    if simulator not in simulators():
        raise ValueError(f"make: simulator must be one of {', '.join(simulators())}; got {simulator!r}.")
    if simulator == "rotorpy":
        optional_import.require_rotorpy()
    if quality not in QUALITIES:
        raise ValueError(f"make: quality must be one of {', '.join(QUALITIES)}; got {quality!r}.")
    if not 5 <= seconds <= 300:
        raise ValueError(f"make: seconds must be 5 … 300 [s]; got {seconds}.")
    if cases < 1:
        raise ValueError("make: there must be at least one case; got none.")
