"""Makes a challenge set: case folders here, their truth elsewhere."""

import dataclasses as dc
import json
import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from diagrams.batch.run import FailedRun, Workers, every_result, require
from diagrams.evidence.challenge.case import (
    FILES,
    NOISE,
    Case,
    CaseDraw,
    SetRequest,
    case_name,
    draw_case,
)
from diagrams.evidence.challenge.flight import Simulation, fly
from diagrams.evidence.challenge.sensors import kept_rows, with_sensor_noise
from diagrams.evidence.challenge.truth import TRUTH_FILE, GroundTruth
from np_drake.files.file_access import kept_json, write_json
from np_drake.files.yaml_file import check_fields
from np_drake.flight_log import FlightLog
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.opening import VEHICLE
from np_drake.vehicle.text import save_vehicle

ATTEMPTS = 12  # draws of one case before the set fails


def make(
    out: Path,
    truth: Path,
    request: SetRequest | None = None,
    *,
    workers: Workers | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict:
    """Write a challenge set: case folders, and their truth elsewhere. Cases of the same request
    that are there stay.

    Args:
        request: what is asked for; None: the defaults.
        on_progress: called with the number of cases done and that of all.
    Returns: {"written", "kinds": {kind: count}, "redrawn": how many draws were lost on the way,
        "lost": which}.
    Raises: ValueError: on an impossible request; FailedRun: where a case cannot be flown in any
        draw.
    """
    request = request or SetRequest()
    check_request(request, out, truth)
    for folder in (out, truth):
        folder.mkdir(parents=True, exist_ok=True)
    draws = request.draws()

    def keep(case: dict, result: dict) -> dict:
        write_case(result, out, truth)
        return {}

    records = (workers or Workers()).run(
        partial(make_case, request=request),
        [dc.asdict(draw) for draw in draws if not is_there(draw, request, out, truth)],
        config={},
        keep=keep,
        on_progress=on_progress,
    )
    every_result(records)
    lost: Counter[str] = Counter()
    for draw in draws:
        path = truth / case_name(request.seed, draw.index) / TRUTH_FILE
        attempt = json.loads(path.read_text(encoding="utf-8"))["attempt"]
        lost.update({" + ".join(draw.names) or draw.kind: attempt} if attempt else {})
    kinds = dict(sorted(Counter(draw.kind for draw in draws).items()))
    return {"written": len(draws), "kinds": kinds, "redrawn": lost.total(), "lost": dict(lost)}


def make_case(case: dict, request: SetRequest) -> dict:
    """Return {"name", "files": text by name, "truth"} of the fields of a `CaseDraw`, drawn until
    the vehicle is not lost and no library effect explains the case; writes nothing here.

    Raises: FailedRun: if no draw can be flown.
    """
    last: FailedRun | None = None
    for attempt in range(ATTEMPTS):
        draw = CaseDraw(case["index"], case["kind"], tuple(case["names"]), attempt)
        drawn = draw_case(draw, request)
        try:
            exact, noisy = fly_case(drawn)
            truth = GroundTruth(drawn, exact, noisy)
            if same := truth.equivalent_library_effects():
                names = " with ".join(draw.names)
                raise FailedRun(f"make: {names} must be no {same[0]} where it is flown.")
            return {
                "name": case_name(request.seed, draw.index),
                "files": _case_files(drawn, noisy),
                "truth": truth.content() | {"version": version("np_drake")},
            }
        except FailedRun as error:
            last = error
    raise FailedRun(f"make: no draw of {tuple(case['names'])} could be flown; the last: {last}")


def is_there(draw: CaseDraw, request: SetRequest, out: Path, truth: Path) -> bool:
    """Return whether both folders of the case are there and of this request."""
    name = case_name(request.seed, draw.index)
    content = kept_json(truth / name / TRUTH_FILE) or {}
    asked = {"kind": draw.kind, "version": version("np_drake")}
    asked |= {key: getattr(request, key) for key in ("simulator", "quality", "seconds", "seed")}
    names = {effect["effect"] for effect in content.get("effects", ())}
    there = (out / name / VEHICLE).is_file() and asked.items() <= content.items()
    return there and set(draw.names) <= names


def fly_case(case: Case) -> tuple[dict[str, FlightLog], dict[str, FlightLog]]:
    """Return the exact and the noisy logs of a case by file, with the same rows."""
    exact = {}
    noisy = {}
    for flight, (file, plan) in enumerate(case.plans.items()):
        log = fly(
            case.vehicle,
            plan,
            case.effects_of(file),
            t=case.instants(file),
            onset=case.onset[file],
            background=case.quality.background(case.vehicle),
            simulation=Simulation(case.request.simulator),
        )
        log.name = file.removesuffix(".csv")
        rng = case.stream(NOISE, flight)
        rows = kept_rows(rng, case.quality, len(log))
        sensed = with_sensor_noise(log, case.vehicle, case.quality, rng)
        exact[file], noisy[file] = log.taken(rows), sensed.taken(rows)
    return exact, noisy


def _case_files(case: Case, noisy: dict[str, FlightLog]) -> dict[str, str]:
    """Return the text of every file of a case folder by its name."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        save_vehicle(case.vehicle, folder / VEHICLE)
        for file in FILES:
            write_log(noisy[file], folder / file)
        return {path.name: path.read_bytes().decode() for path in sorted(folder.iterdir())}


def write_case(made: dict, out: Path, truth: Path) -> None:
    """Write both folders of a case that `make_case` returned, each whole or not at all; older ones
    give way.
    """
    for parent in (truth, out):
        # A name behind a dot, so that what a killed run left is taken away.
        folder = parent / made["name"]
        temporary = parent / f".{made['name']}"
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir()
        if parent is truth:
            write_json(temporary / TRUTH_FILE, made["truth"])
        else:
            for name, text in made["files"].items():
                (temporary / name).write_bytes(text.encode())
        shutil.rmtree(folder, ignore_errors=True)
        os.replace(temporary, folder)


def check_request(request: SetRequest, out: Path, truth: Path) -> None:
    """Raise ValueError where `make` would, before any work."""
    here = out.resolve()
    there = truth.resolve()
    require(
        here != there and here not in there.parents and there not in here.parents,
        f"make: neither of cases and truth may lie in the other; got {out} and {truth}.",
    )
    check_fields(request, "make")
    require(
        request.simulator != "rotorpy" or find_spec("rotorpy") is not None,
        "simulator: for rotorpy its package must be installed; pip install 'np_drake[challenge]'.",
    )
    cases = request.cases + request.clean
    require(cases >= 1, "make: there must be at least one case; got none.")
    # Two sets in one folder could not be told apart; what begins with a dot is of a killed run.
    names = {case_name(request.seed, index) for index in range(cases)}
    for folder in (out, truth):
        others = sorted({path.name for path in folder.glob("[!.]*")} - names)
        if others:
            raise ValueError(
                f"make: {folder} holds another set, or {others[0]}; give an empty folder."
            )
