"""Frozen cases and their answers: a check that a change of the code changes no diagnosis.

The cases are fixed by name and remade from their seed: every effect of the library in both
simulators, pairs, triples, onsets, out-of-library effects and clean controls, in both sensor
qualities. Where NP_DRAKE_NEUROBEM names the published real flights, two diagnoses of them are
compared as well. The suite answers six cases, this script all of them:

    python tests/golden/frozen_cases.py [--jobs N] [--only CASE …] [--out FILE]

Exit code 1 where an answer differs from the stored one.
"""

import argparse
import dataclasses as dc
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import pytest
from joblib import Parallel, delayed

from diagrams.evidence.challenge.answers import diagnose_folder
from diagrams.evidence.challenge.case import CLEAN, CaseDraw, SetRequest, case_name
from diagrams.evidence.challenge.make import make_case, write_case
from np_drake.diagnosis.diagnose import diagnose
from np_drake.files.file_access import write_text
from np_drake.logs.formats.neurobem import published_vehicle
from np_drake.logs.opening import open_flights

SEED, SECONDS = 36, 10.0
DIGITS = 10  # significant ones that are stored
REAL = "neurobem"
AGILE = (  # flights that excite the aerodynamics
    "2021-02-18-16-43-54_seg_3",
    "2021-02-18-17-19-08_seg_2",
    "2021-02-23-10-48-03_seg_2",
    "2021-02-23-11-41-38_seg_3",
)
STORED = Path(__file__).with_name("answers.json")
TOLERANCE = 1e-6  # largest relative difference on one machine
Settings = tuple[str, str, CaseDraw]  # simulator, quality, draw
SCHEMA = "np_drake.golden/1"


def golden_cases() -> dict[str, Settings]:
    """Return every simulated case by name, as `kind/effects/simulator/quality`.

    A case's place in the file is its index, which seeds its flights: a new one stands last, as null
    until it is answered.
    """
    cases: dict[str, Settings] = {}
    for index, name in enumerate(name for name in read_answers(STORED) if REAL not in name):
        kind, label, simulator, quality = name.split("/")
        names = () if kind == CLEAN else tuple(label.split("+"))
        cases[name] = (simulator, quality, CaseDraw(index, kind, names))
    return cases


def answer(name: str, neurobem: Path | None = None) -> dict[str, Any]:
    """Fly and diagnose one case, and return the answer, rounded."""
    if name.startswith(f"{REAL}/"):
        if neurobem is None:
            raise ValueError(f"golden: {name} needs the folder of the NeuroBEM flights.")
        paths = [neurobem / "csv" / f"merged_{one}.csv" for one in AGILE]
        flights, held = [open_flights(path)[0][0] for path in paths], int(name.split("/")[1])
        train = [flights[(held + 1) % len(flights)]]
        test = [flights[held]]
        return summary(diagnose(train, test, published_vehicle(), adaptive_split=False).as_json())
    simulator, quality, draw = golden_cases()[name]
    with tempfile.TemporaryDirectory() as scratch:
        cases, truth = Path(scratch) / "cases", Path(scratch) / "truth"
        cases.mkdir()
        truth.mkdir()
        request = SetRequest(simulator, quality, seconds=SECONDS, seed=SEED)
        write_case(make_case(dc.asdict(draw), request), cases, truth)
        return summary(diagnose_folder(cases / case_name(SEED, draw.index), replay=False))


def summary(diagnosis: dict[str, Any]) -> dict[str, Any]:
    """Return the part of `diagnosis.json` that must not change."""
    residual = diagnosis["shrink"]["residual"]
    return {
        "verdict": diagnosis["verdict"],
        "unknown_probability": _rounded(diagnosis["unknown_probability"]),
        "causes": {
            cause["effect"]: {
                "probability": _rounded(cause["probability"]),
                "parameters": {
                    name: [_rounded(p["value"]), *map(_rounded, p["ci95"])]
                    for name, p in cause["parameters"].items()
                },
                "onset": {flight: _rounded(time) for flight, time in cause["onset"].items()},
                "indistinguishable_from": sorted(cause["indistinguishable_from"]),
            }
            for cause in diagnosis["causes"]
        },
        "residual": {key: _rounded(residual[key]) for key in ("before", "after", "floor")},
        "minor": [finding["name"] for finding in diagnosis["minor"]],
        "remains": [finding["name"] for finding in diagnosis["remains"]],
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.{DIGITS}g}")


def write_answers(path: Path, answers: dict[str, dict[str, Any]]) -> None:
    """Write answers as JSON, a case a line."""
    head = {"schema": SCHEMA, "seed": SEED, "seconds": SECONDS}
    dense = {name: json.dumps(value, separators=(",", ":")) for name, value in answers.items()}
    body = ",\n".join(f"{json.dumps(name)}: {value}" for name, value in dense.items())
    write_text(path, f'{json.dumps(head)[:-1]}, "answers": {{\n{body}\n}}}}\n')


def read_answers(path: Path) -> dict[str, dict[str, Any]]:
    """Return the stored answers by case."""
    return json.loads(path.read_text(encoding="utf-8"))["answers"]


def differences(reference: Any, found: Any, tolerance: float, place: str = "") -> list[str]:
    """Return one line for every value of an answer that differs; of another verdict that alone.

    tolerance: of a parameter, relative to the larger of its value and its interval; of all else
    absolute [1, s].
    """
    if isinstance(reference, dict):
        other = reference.get("verdict") != found.get("verdict")
        return [
            line
            for key in (["verdict"] if other else reference)
            for line in differences(reference[key], found[key], tolerance, f"{place}{key}: ")
        ]
    values = reference if isinstance(reference, list) else ()
    scale = max((abs(value) for value in values if isinstance(value, float)), default=0.0) or 1.0
    same = reference == pytest.approx(found, abs=tolerance * scale)
    return [] if same else [f"{place}{reference} -> {found}"]


def main() -> int:
    """Answer the cases, compare with the stored answers and return the exit code."""
    folder = os.environ.get("NP_DRAKE_NEUROBEM")
    neurobem = Path(folder) if folder else None
    every = [*golden_cases(), *([f"{REAL}/0", f"{REAL}/1"] if neurobem else [])]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    how = {"nargs": "*", "choices": every, "metavar": "CASE"}
    parser.add_argument("--only", help="these cases alone", **how)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--out", type=Path, help="write the answers")
    asked = parser.parse_args()
    names = asked.only or every
    found = Parallel(asked.jobs)(delayed(answer)(name, neurobem) for name in names)
    answers = dict(zip(names, found, strict=True))
    if asked.out is not None:
        write_answers(asked.out, answers)
    stored, differing = read_answers(STORED), 0
    for name, given in answers.items():
        lines = differences(stored[name], given, TOLERANCE)
        print(*(f"{name}: {line}\n" for line in lines), sep="", end="")
        differing += bool(lines)
    said = f"{len(answers)} answers compared with {STORED.name}"
    print(f"{said}, {differing} differ by more than {TOLERANCE:g}")
    return int(differing > 0)


if __name__ == "__main__":
    sys.exit(main())
