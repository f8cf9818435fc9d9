"""A case with its truth and its answer, as read from files and checked
(docs/reference/files.md).
"""

import dataclasses as dc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from diagrams.challenge.draw import CLEAN, OUT_OF_LIBRARY
from diagrams.challenge.score.schema import (
    SchemaValidator,
    list_of,
    object_of,
    or_null,
    record,
    violation,
)
from diagrams.challenge.truth import TRUTH_FILE
from np_drake.diagnosis.result import UNKNOWN
from np_drake.effects.library import LIBRARY, MEASURED_ROTORS
from np_drake.files.input_file import read_json

KINDS = ("single", "pair", "triple", "onset", CLEAN, OUT_OF_LIBRARY)
ANYTHING = {"description": "of any kind"}
TEXT = {"description": "text", "type": "string"}
KIND = {"description": f"one of {', '.join(KINDS)}", "enum": list(KINDS)}
FLAG = {"description": "true or false", "type": "boolean"}
WHOLE = {"description": "a whole number", "type": "integer"}
NUMBER = {"description": "a finite number", "type": "number"}
SIZE = {"description": "a finite number, at least 0", "type": "number", "minimum": 0}
SHARE = {**SIZE, "description": "a finite number, at least 0 and at most 1", "maximum": 1}
BOUNDS = {
    **list_of(or_null(NUMBER)),
    "description": "a list of 2, each a finite number, or null",
    "minItems": 2,
    "maxItems": 2,
}
INSTANTS = object_of(or_null(NUMBER))  # by flight [s]
RESIDUAL = record({f"{kind}_{axis}": SIZE for kind in ("force", "torque") for axis in "xyz"})
EFFECT = record({"effect": TEXT, "parameters": object_of(ANYTHING)}, spare={"onset": INSTANTS})
TRUTH = SchemaValidator(
    record(
        {
            "effects": list_of(EFFECT),
            "class": list_of(list_of(TEXT)),
            "true_model_residual": RESIDUAL,
            "visibility": SIZE,
            "simulator": TEXT,
            "quality": TEXT,
            "kind": KIND,
            "seed": WHOLE,
        },
        spare={
            "parameters_residual": or_null(RESIDUAL),
            "best_onset": object_of(NUMBER),
            "visibility_in_training": object_of(SIZE),
            "within_tolerance": list_of(FLAG),
        },
    )
)
PARAMETERS = SchemaValidator(object_of(NUMBER))  # of an effect of the library

ESTIMATE = record({"value": or_null(NUMBER), "ci95": BOUNDS})
CAUSE = record(
    {"effect": TEXT, "parameters": object_of(ESTIMATE)},
    spare={
        "probability": or_null(SHARE),
        "onset": INSTANTS,
        "indistinguishable_from": list_of(TEXT),
    },
)
CHANNEL = record({}, spare={"rms": or_null(SIZE), "after": or_null(SIZE)})
AXES = record({}, spare=dict.fromkeys("xyz", CHANNEL))
MEDIANS = or_null(record({"position": list_of(or_null(NUMBER))}))
REPLAY = record({"horizon": list_of(NUMBER)}, spare={"before": MEDIANS, "after": MEDIANS})
ANSWER = SchemaValidator(
    record(
        {
            "verdict": list_of(TEXT),
            "causes": list_of(CAUSE),
            "gap": record({}, spare={"force": AXES, "torque": AXES}),
            "shrink": record({}, spare={"replay": or_null(REPLAY)}),
        },
        spare={"wall": or_null(SIZE), "joined": list_of(TEXT)},
    )
)


def fault_of_truth(truth: dict[str, Any]) -> str | None:
    """Return a sentence on the first field of a truth that is wrong or contradicts others; None:
    there is none.
    """
    return violation(TRUTH, truth) or next(_disagreements(truth), None)


def fault_of_answer(answer: dict[str, Any]) -> str | None:
    """Return a sentence on the first field of an answer that is wrong; None: there is none."""
    return violation(ANSWER, answer) or next(_unlike(answer["shrink"].get("replay") or {}), None)


def _disagreements(truth: dict[str, Any]) -> Iterator[str]:
    """Yield what in a truth contradicts: names not in the library, effects without a class."""
    kind, effects, classes = truth["kind"], truth["effects"], truth["class"]
    if (kind == CLEAN) != (not effects):
        must = "be empty" if kind == CLEAN else "name what acts"
        yield f"effects must {must} in a case of kind {kind}; got {len(effects)}."
    if len(classes) != len(effects):
        yield f"class must hold a list for each of {len(effects)} effects; got {len(classes)}."
    lost = truth.get("within_tolerance", effects)
    if len(lost) != len(effects):
        yield (
            f"within_tolerance must hold a flag for each of {len(effects)} effects; got "
            f"{len(lost)}."
        )
    for i, (effect, names) in enumerate(zip(effects, classes, strict=False)):
        own = effect["effect"]
        if kind != OUT_OF_LIBRARY:
            if own not in LIBRARY:
                yield f"effects[{i}].effect must be an effect of the library; got {own!r}."
            wrong = violation(PARAMETERS, effect["parameters"], f"effects[{i}].parameters")
            if wrong is not None:
                yield wrong
        for name in names:
            if name not in LIBRARY | MEASURED_ROTORS and name != own:
                yield f"class[{i}] must hold effects of the library; got {name!r}."


def _unlike(replay: dict[str, Any]) -> Iterator[str]:
    """Yield replays that lack an error for a horizon."""
    for name in [name for name in ("before", "after") if replay.get(name) is not None]:
        given, asked = len(replay[name]["position"]), len(replay["horizon"])
        if given != asked:
            yield (
                f"shrink.replay.{name}.position must hold an error for each of {asked} "
                f"horizons; got {given}."
            )


ANSWER_FILE = "diagnosis.json"
VISIBLE = 1.5  # least visibility of a case that must be found [1]


@dc.dataclass(frozen=True)
class AnsweredCase:
    """A case with the content of truth.json and diagnosis.json; answer None: there is none."""

    name: str
    truth: dict[str, Any]
    answer: dict[str, Any] | None
    least: float = VISIBLE  # visibility from which the case must be found [1]

    @property
    def kind(self) -> str:
        """Return the kind: single | pair | triple | onset | clean | foreign."""
        return str(self.truth["kind"])

    @property
    def group(self) -> str:
        """Return simulator and quality, as `drake, real`."""
        return f"{self.truth['simulator']}, {self.truth['quality']}"

    @property
    def visibility(self) -> float:
        """Return the largest ratio of a channel's RMS to its noise [1].

        1 where all that acts is within what vehicle file, input and sensors may be off by: nobody
        can tell.
        """
        if self.true_names and not self.must_be_named:
            return 1.0
        return float(self.truth["visibility"])

    @property
    def visible(self) -> bool:
        """Return whether the case must be found."""
        return self.visibility >= self.least

    @property
    def must_be_named(self) -> tuple[int, ...]:
        """Return the numbers of the true effects that are not within what the files may be off
        by.
        """
        lost = self.truth.get("within_tolerance") or [False] * len(self.true_names)
        return tuple(i for i, within in enumerate(lost) if not within)

    @property
    def visibility_in_training(self) -> float:
        """Return the largest visibility in the training flights; 0 where the truth does not say
        [1].
        """
        return max(self.truth.get("visibility_in_training", {}).values(), default=0.0)

    def visibility_in(self, flight: str) -> float:
        """Return the visibility in one flight; that of the case where the truth does not say
        [1].
        """
        return float(self.truth.get("visibility_in_training", {}).get(flight, self.visibility))

    @property
    def true_names(self) -> tuple[str, ...]:
        """Return the names of all effects that act."""
        return tuple(effect["effect"] for effect in self.truth["effects"])

    @property
    def main(self) -> str:
        """Return the effect that a case of one effect is about (a wind's drag comes after it),
        `foreign` or `clean`.
        """
        return OUT_OF_LIBRARY if self.kind == OUT_OF_LIBRARY else next(iter(self.true_names), CLEAN)

    @property
    def verdict(self) -> tuple[str, ...]:
        """Return all that is said to be missing, `unknown` among it; without an answer nothing."""
        return () if self.answer is None else tuple(self.answer["verdict"])

    @property
    def named(self) -> tuple[str, ...]:
        """Return the verdict without `unknown`."""
        return tuple(name for name in self.verdict if name != UNKNOWN)

    @property
    def causes(self) -> dict[str, dict[str, Any]]:
        """Return the causes of the answer by effect."""
        return {} if self.answer is None else {c["effect"]: c for c in self.answer["causes"]}


def read_answered_cases(answers: Path, truth: Path, least: float = VISIBLE) -> list[AnsweredCase]:
    """Return every case that has a truth, sorted by name; of a folder of sets, `<set>/<case>`.

    Args:
        least: visibility from which a case must be found [1].
    Raises: ValueError: if there is no truth, or a file is no JSON or not what
        docs/reference/files.md says: one line with file, field and what it must be; OSError: if one
        cannot be read.
    """
    names = [
        file.parent.relative_to(truth)
        for file in sorted(truth.rglob(TRUTH_FILE))
        if file.parent != truth
    ]
    if not names:
        raise ValueError(f"{truth}: must hold <case>/{TRUTH_FILE}; got none.")
    cases = []
    for name in names:
        file = answers / name / ANSWER_FILE
        answer = read_checked(file, fault_of_answer) if file.is_file() else None
        cases.append(
            AnsweredCase(
                str(name), read_checked(truth / name / TRUTH_FILE, fault_of_truth), answer, least
            )
        )
    return cases


def read_checked(path: Path, fault_of: Callable[[dict[str, Any]], str | None]) -> dict[str, Any]:
    """Return the content of a JSON file that holds an object.

    Args:
        fault_of: returns what is wrong with the content, in a sentence, or None.
    Raises: ValueError: one line with file, field and what it must be; OSError: if it cannot be
        read.
    """
    fault: str | None = "must hold a JSON object."
    try:
        content = read_json(path)
        if isinstance(content, dict):
            fault = fault_of(content)
    except (ValueError, RecursionError):  # no JSON; too deep to be read or to be quoted
        pass
    if fault is not None:
        raise ValueError(f"{path}: {fault}")
    return content
