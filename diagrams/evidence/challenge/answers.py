"""Answers to a challenge set: made by the diagnosis, read beside their truth, and checked by the
schemas beside this module (docs/reference/files.md).
"""

import json
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator
from jsonschema.protocols import Validator
from jsonschema.validators import extend

from diagrams.batch.run import Case, Workers, require
from diagrams.evidence.challenge.truth import TRUTH_FILE
from diagrams.gap.drake_replay import DrakeReplay
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.result import UNKNOWN
from np_drake.files.file_access import kept_json, read_json, write_json
from np_drake.files.yaml_file import shown
from np_drake.logs.opening import TRAIN, VEHICLE, open_case

ANSWER_FILE = "diagnosis.json"
VISIBLE = 1.5  # least visibility of a case that must be found [1]


def _is_number(checker: Any, value: Any) -> bool:
    """JSON Schema itself would take NaN, Infinity and what overflows."""
    numeric = isinstance(value, (int, float)) and not isinstance(value, bool)
    return numeric and abs(value) <= sys.float_info.max


TYPES = Draft202012Validator.TYPE_CHECKER.redefine("number", _is_number)
SchemaValidator = extend(Draft202012Validator, type_checker=TYPES)


# In a schema, `description` says what a value must be, in the words that follow "must be".
TRUTH, ANSWER, REAL_ANSWER = (
    SchemaValidator(json.loads(Path(__file__).with_name(f"{name}.schema.json").read_text("utf-8")))
    for name in ("truth", "diagnosis", "real_diagnosis")
)


def violation(form: Validator, value: Any) -> str | None:
    """Return where the value first violates the schema, what it must be there and what it is; None
    where it suits.
    """
    error = next(form.iter_errors(value), None)
    if error is None:
        return None
    steps = (
        f"[{step}]" if isinstance(step, int) else f".{' '.join(step.split())}"
        for step in error.absolute_path
    )
    place = "".join(steps).removeprefix(".")
    if error.validator != "required":
        must = error.schema["description"]
        return f"{place or 'it'} must be {must}; got {shown(error.instance)}."
    name = next(name for name in error.validator_value if name not in error.instance)
    must = error.schema["properties"][name]["description"]
    return f"{place}{'.' if place else ''}{name} is missing; it must be {must}."


def read_answer(path: Path, form: Validator) -> dict[str, Any] | None:
    """Return the checked content of an answer; None where there is none."""
    return read_checked(path, form) if path.is_file() else None


def read_checked(path: Path, form: Validator) -> dict[str, Any]:
    """Return the content of a JSON file that holds an object.

    Raises: ValueError: one line with file, field and what it must be; OSError: if it cannot be
        read.
    """
    wrong: str | None = "must hold a JSON object."
    try:
        content = read_json(path)
        wrong = violation(form, content) if isinstance(content, dict) else wrong
    except (ValueError, RecursionError):  # no JSON; too deep to be read or to be quoted
        pass
    require(wrong is None, f"{path}: {wrong}")
    return content


class AnsweredCase:
    """A case with the content of truth.json and diagnosis.json; answer None: there is none.

    kind: single | pair | triple | onset | clean | foreign. group: simulator and quality, as `drake,
    real`. true_names: all effects that act. visibility: largest ratio of a channel's RMS to its
    noise [1]. visible: whether the case must be found. verdict: all that is said to be missing.
    named: the same without `unknown`. causes: of the answer, by effect.
    """

    def __init__(
        self,
        name: str,
        truth: dict[str, Any],
        answer: dict[str, Any] | None,
        least: float = VISIBLE,
    ):
        """Take a case that must be found from a visibility `least` on [1]."""
        self.name = name
        self.truth = truth
        self.answer = answer
        self.least = least
        self.kind = str(truth["kind"])
        content = answer or {"verdict": (), "causes": ()}
        self.group = f"{truth['simulator']}, {truth['quality']}"
        self.true_names = tuple(effect["effect"] for effect in truth["effects"])
        self.visibility = float(truth["visibility"])
        self.visible = self.visibility >= least
        self.verdict = tuple(content["verdict"])
        self.named = tuple(name for name in self.verdict if name != UNKNOWN)
        self.causes = {cause["effect"]: cause for cause in content["causes"]}


def read_answered_cases(answers: Path, truth: Path, least: float = VISIBLE) -> list[AnsweredCase]:
    """Return every case that has a truth, sorted by name; of a folder of sets, `<set>/<case>`.

    Raises: ValueError: if there is no truth, or a file is no JSON or not what
        docs/reference/files.md says: one line with file, field and what it must be; OSError: if one
        cannot be read.
    """
    names = [
        file.parent.relative_to(truth)
        for file in sorted(truth.rglob(TRUTH_FILE))
        if file.parent != truth
    ]
    require(bool(names), f"{truth}: must hold <case>/{TRUTH_FILE}; got none.")
    cases = []
    for name in names:
        known = read_checked(truth / name / TRUTH_FILE, TRUTH)
        require(
            len(known["effects"]) == len(known["class"]),
            f"{truth / name / TRUTH_FILE}: class must hold one for each effect.",
        )
        answer = read_answer(answers / name / ANSWER_FILE, ANSWER)
        cases.append(AnsweredCase(str(name), known, answer, least))
    return cases


# Answers by the diagnosis, from case folders alone: no truth is opened.


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
    unsolved = [f for f in folders if again or kept_json(answers / f.name / ANSWER_FILE) is None]

    def keep(case: Case, result: dict) -> dict:
        out = answers / case["case"]
        out.mkdir(parents=True, exist_ok=True)
        write_json(out / ANSWER_FILE, result["answer"])
        return {"wall": result["wall"]}

    records = (workers or Workers()).run(
        partial(solve_case, cases=cases.resolve(), replay=replay),
        [{"case": folder.name} for folder in unsolved],
        config={"replay": replay},
        keep=keep,
        on_progress=on_progress,
    )
    return {
        "cases": len(folders),
        "skipped": len(folders) - len(unsolved),
        "solved": [{**r["case"], **r["result"]} for r in records if "result" in r],
        "failed": [{**r["case"], "error": r["error"]} for r in records if "error" in r],
    }


def case_folders(cases: Path) -> list[Path]:
    """Return every folder with a vehicle file or a flight to fit, complete or not, sorted.

    Raises: ValueError: if there is none.
    """
    folders = [path for path in cases.iterdir() if path.is_dir() and not path.name.startswith(".")]
    named = sorted(f for f in folders if (f / VEHICLE).is_file() or any(f.glob(f"{TRAIN}*")))
    require(
        bool(named), f"{cases}: must hold case folders, each with {VEHICLE} and flights; got none."
    )
    return named


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
    diagnosis = diagnose(train, held_out, vehicle, DrakeReplay(vehicle) if replay else None)
    return (diagnosis.refit or diagnosis).as_json()
