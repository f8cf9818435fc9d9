"""Answers of any tool to the cases: `<group>/<case>/diagnosis.json` in a folder, of which the score
needs a part.
"""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from diagrams.challenge.real.rules import Case
from diagrams.challenge.score.answered_case import (
    ANSWER_FILE,
    AXES,
    BOUNDS,
    INSTANTS,
    NUMBER,
    SHARE,
    SIZE,
    TEXT,
    read_checked,
)
from diagrams.challenge.score.schema import (
    SchemaValidator,
    list_of,
    object_of,
    or_null,
    record,
    violation,
)
from np_drake.effects.base import Effect
from np_drake.effects.library import causes
from np_drake.files.atomic_file import write_json

Answer = Mapping[str, Any]
PARAMETER = record({"value": or_null(NUMBER)}, spare={"ci95": BOUNDS})
CAUSE = record(
    {"effect": TEXT, "probability": SHARE},
    spare={"parameters": object_of(PARAMETER), "onset": INSTANTS, "absent_from": list_of(TEXT)},
)
OPTIONAL = {
    "gap": record({}, spare={"force": AXES, "torque": AXES}),
    "shrink": record({}, spare={"residual": record({}, spare={"fraction": or_null(NUMBER)})}),
    "remains": list_of(record({"name": TEXT})),
    "wall": or_null(SIZE),
    "unknown_probability": or_null(SHARE),
    "refit": or_null(record({"causes": list_of(CAUSE)})),
}
FORM = SchemaValidator(record({"causes": list_of(CAUSE)}, spare=OPTIONAL))
HEAD = (
    "schema",
    "vehicle",
    "train",
    "held_out",
    "verdict",
    "cannot_tell",
    "warnings",
)  # kept for a reader
PARTS = {
    "gap": ("force", "torque"),
    "shrink": ("residual",),
    "refit": ("verdict", "causes", "unknown_probability"),
}


def read_answer(folder: Path, case: Case) -> dict[str, Any] | None:
    """Return the answer to a case; None where the folder holds none.
    Raises: ValueError: one line with file and field, if it is no such answer.
    """
    file = folder / case.folder / ANSWER_FILE
    return read_checked(file, lambda content: violation(FORM, content)) if file.is_file() else None


def require_answers(name: str, folder: Path, cases: Sequence[Case]) -> list[str]:
    """Return a line on cases without an answer, in a list; none where all have one.
    Raises: ValueError: if the folder holds the answer of no case, or one that is none.
    """
    missing = [case for case in cases if read_answer(folder, case) is None]
    if len(missing) == len(cases):
        raise ValueError(
            f"{name}: {folder} must hold <group>/<case>/{ANSWER_FILE}, as "
            f"{_file(cases[0])}; got none."
        )
    first = f"; the first: {_file(missing[0])}" if missing else ""
    return [f"{name}: {len(missing)} of {len(cases)} cases have no answer{first}"] * bool(missing)


def _file(case: Case) -> Path:
    return case.folder / ANSWER_FILE


def brief(answer: Answer) -> dict[str, Any]:
    """Return the part of a `diagnosis.json` that is scored, and its head."""
    kept = {key: answer[key] for key in (*HEAD, "causes", *OPTIONAL) if key in answer}
    for key, names in PARTS.items():
        if isinstance(kept.get(key), Mapping):
            kept[key] = {name: kept[key][name] for name in names if name in kept[key]}
    return kept


def write_answers(folder: Path, answers: Mapping[Path, Answer]) -> None:
    """Write answers as `read_answer` reads them."""
    for own, answer in answers.items():
        (folder / own).mkdir(parents=True, exist_ok=True)
        write_json(folder / own / ANSWER_FILE, answer)


def effects_of(answer: Answer, names: Collection[str]) -> list[Effect]:
    """Return the effects of an answer at their values, as far as the library knows them.

    Args:
        answer: content of `diagnosis.json`.
    """
    found = []
    for cause in answer["causes"]:
        kind = causes().get(cause["effect"]) if cause["effect"] in names else None
        if kind is not None:
            known, given = {p.name for p in kind.parameters}, cause.get("parameters", {})
            values = {
                n: e["value"] for n, e in given.items() if n in known and e["value"] is not None
            }
            found.append(kind(**values))
    return found
