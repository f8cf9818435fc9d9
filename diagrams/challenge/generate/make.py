"""Makes a challenge set: case folders here, their truth elsewhere."""

import dataclasses as dc
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

from diagrams.batch.failed_run import FailedRun
from diagrams.batch.run import Workers
from diagrams.challenge.generate.case import FILES, NOISE, Case, CaseDraw, case_name, draw_case
from diagrams.challenge.generate.composition import TWO_AT_ONCE, compose
from diagrams.challenge.generate.ground_truth import TRUTH_FILE, GroundTruth
from diagrams.challenge.generate.logged_input import as_logged, per_row, with_input
from diagrams.challenge.generate.sensor_quality import (
    QUALITIES,
    WILD,
    kept_rows,
    rows_of,
    with_sensor_noise,
)
from diagrams.challenge.simulators.drake.simulator import fly
from diagrams.challenge.simulators.rotorpy import optional_import
from np_drake.files.atomic_file import write_json, write_text
from np_drake.flight_log import FlightLog
from np_drake.logs.case_folder import VEHICLE
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.import_sheet import write_sheet
from np_drake.vehicle.text import vehicle_text

ATTEMPTS = 12  # draws of one case before the set fails


def simulators() -> dict[str, Callable[..., FlightLog]]:
    """Return simulators by name: fly(vehicle, plan, effects, *, t, onset, background) -> the exact
    FlightLog.
    """
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
    workers: Workers | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict:
    """Write a challenge set: case folders, and their truth elsewhere. Cases of the same request
    that are there stay.

    Args:
        quality: of the sensors: clean (ideal) | real | wild (ill-calibrated).
        seconds: length of every flight [s].
        unseen: whether all `cases` have an out-of-library effect that is held out from other sets.
        on_progress: called with the number of cases done and that of all.
    Returns: {"written", "kinds": {kind: count}, "redrawn": how many draws were lost on the way,
        "lost": which}.
    Raises: ValueError: on impossible arguments; FailedRun: where a case cannot be flown in any
        draw.
    """
    check_request(out, truth, simulator, quality, cases + clean, seconds, seed)
    for folder in (out, truth):
        folder.mkdir(parents=True, exist_ok=True)
    draws = compose(cases, clean, seed, unseen=unseen, two=TWO_AT_ONCE if quality == WILD else 0.0)
    making = Making(simulator, quality, seconds, seed)
    left = [draw for draw in draws if not making.is_there(draw, out, truth)]

    def keep(case: dict, result: dict) -> dict:
        write_case(result, out, truth)
        return {}

    records = (workers or Workers()).run(
        making, [dc.asdict(draw) for draw in left], config={}, keep=keep, on_progress=on_progress
    )
    if failed := [record["error"] for record in records if "error" in record]:
        raise FailedRun(f"{failed[0]} ({len(failed)} of {len(draws)} cases failed)")
    return _set_summary(draws, truth, seed)


def _set_summary(draws: Sequence[CaseDraw], truth: Path, seed: int) -> dict:
    """Return what `make` returns of a whole set."""
    lost: dict[str, int] = {}
    for draw in draws:
        content = json.loads(
            (truth / case_name(seed, draw.index) / TRUTH_FILE).read_text(encoding="utf-8")
        )
        if content["attempt"]:
            name = " + ".join(draw.names) or draw.kind
            lost[name] = lost.get(name, 0) + content["attempt"]
    kinds = {
        kind: sum(draw.kind == kind for draw in draws) for kind in sorted({d.kind for d in draws})
    }
    return {"written": len(draws), "kinds": kinds, "redrawn": sum(lost.values()), "lost": lost}


@dc.dataclass(frozen=True)
class Making:
    """Work of a case, the fields of a `CaseDraw` -> {"name", "files": text by name, "truth"};
    writes nothing here.
    """

    simulator: str
    quality: str
    seconds: float
    seed: int

    def __call__(self, case: dict) -> dict:
        """Draw the case until its vehicle is not lost and no library effect explains it.

        Raises: FailedRun: if no draw can be flown.
        """
        last: FailedRun | None = None
        for attempt in range(ATTEMPTS):
            draw = CaseDraw(case["index"], case["kind"], tuple(case["names"]), attempt)
            drawn = draw_case(draw, quality=self.quality, seed=self.seed, seconds=self.seconds)
            try:
                exact, noisy = fly_case(drawn, self.simulator)
                truth = GroundTruth.of(drawn, exact, noisy)
                if same := truth.equivalent_library_effects():
                    names = " with ".join(draw.names)
                    raise FailedRun(f"make: {names} must be no {same[0]} where it is flown.")
            except FailedRun as error:
                last = error
                continue
            asked = {"seconds": self.seconds, "version": version("np_drake")}
            return {
                "name": drawn.name,
                "files": _case_files(drawn, noisy),
                "truth": {**truth.content(self.simulator), **asked},
            }
        raise FailedRun(f"make: no draw of {tuple(case['names'])} could be flown; the last: {last}")

    def is_there(self, draw: CaseDraw, out: Path, truth: Path) -> bool:
        """Return whether both folders of the case are there and of this request."""
        name = case_name(self.seed, draw.index)
        if not (out / name / VEHICLE).is_file():
            return False
        try:
            found = json.loads((truth / name / TRUTH_FILE).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return False
        asked = {**dc.asdict(self), "kind": draw.kind, "version": version("np_drake")}
        named = {effect["effect"] for effect in found.get("effects", ())}
        return (
            all(found.get(key) == value for key, value in asked.items())
            and set(draw.names) <= named
        )


def fly_case(case: Case, simulator: str) -> tuple[dict[str, FlightLog], dict[str, FlightLog]]:
    """Return the exact and the noisy logs of a case by file, with the same rows; the noisy hold the
    case's input.
    """
    exact, noisy = {}, {}
    for flight, (file, plan) in enumerate(case.plans.items()):
        every = simulators()[simulator](
            case.vehicle,
            plan,
            case.effects_of(file),
            t=case.input.instants(case.instants(file)),  # a row a command
            onset=case.onset[file],
            background=case.quality.background(case.vehicle),
        )
        every.name = file.removesuffix(".csv")
        rng = case.draw.stream(case.seed, NOISE, flight)
        log = per_row(every, case.input.finer)
        rows = kept_rows(rng, case.quality, len(log))
        sensed = with_sensor_noise(log, case.vehicle, case.quality, rng)
        u = as_logged(every, case.input.semantics, case.input.finer, case.input.late).u
        logged = with_input(dc.replace(sensed, u=u), case.vehicle, case.input.kind)
        exact[file], noisy[file] = rows_of(log, rows), rows_of(logged, rows)
    return exact, noisy


def _case_files(case: Case, noisy: dict[str, FlightLog]) -> dict[str, str]:
    """Return the text of every file of a case folder by its name."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        write_text(folder / VEHICLE, vehicle_text(case.vehicle))
        for file in FILES:
            write_log(noisy[file], folder / file)
            if (sheet := case.input.sheet(noisy[file].step)) is not None:
                write_sheet(sheet, folder / file)
        return {path.name: path.read_bytes().decode() for path in sorted(folder.iterdir())}


def write_case(made: dict, out: Path, truth: Path) -> None:
    """Write both folders of a case, each whole or not at all.

    Args:
        made: what a `Making` returned.
    """
    with _whole_folder(truth / made["name"]) as folder:
        write_json(folder / TRUTH_FILE, made["truth"])
    with _whole_folder(out / made["name"]) as folder:
        for name, text in made["files"].items():
            (folder / name).write_bytes(text.encode())


@contextmanager
def _whole_folder(path: Path) -> Iterator[Path]:
    """Yield a temporary folder beside `path` that takes its name at the end; an older folder gives
    way.

    Its name is that of `path` behind a dot, so that what a killed run left is taken away.
    """
    temporary = path.with_name(f".{path.name}")
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir()
    try:
        yield temporary
        if path.exists():
            shutil.rmtree(path)
        os.replace(temporary, path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def check_request(
    out: Path, truth: Path, simulator: str, quality: str, cases: int, seconds: float, seed: int
) -> None:
    """Raise ValueError where `make` would, before any work.

    Args:
        seconds: length of every flight [s].
    """
    here, there = out.resolve(), truth.resolve()
    if here == there or here in there.parents or there in here.parents:
        raise ValueError(
            f"make: neither of cases and truth may lie in the other; got {out} and {truth}."
        )
    if simulator not in simulators():
        raise ValueError(
            f"make: simulator must be one of {', '.join(simulators())}; got {simulator!r}."
        )
    if simulator == "rotorpy":
        optional_import.require_rotorpy()
    if quality not in QUALITIES:
        raise ValueError(f"make: quality must be one of {', '.join(QUALITIES)}; got {quality!r}.")
    if not 5 <= seconds <= 300:
        raise ValueError(f"make: seconds must be 5 … 300 [s]; got {seconds}.")
    if cases < 1:
        raise ValueError("make: there must be at least one case; got none.")
    # Two sets in one folder could not be told apart.
    own = {case_name(seed, index) for index in range(cases)}
    own |= {f".{name}" for name in own}  # of a run that was killed
    for folder in (out, truth):
        others = (
            sorted({path.name for path in folder.glob("[!.]*")} - own) if folder.is_dir() else []
        )
        if others:
            raise ValueError(
                f"make: {folder} holds another set, or {others[0]}; give an empty folder."
            )
