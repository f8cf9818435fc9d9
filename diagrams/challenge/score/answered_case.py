"""A case with its answer and its truth, as read from file."""

import dataclasses as dc
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from diagrams.challenge.score.answer_schema import fault_of_answer, fault_of_truth
from diagrams.challenge.solve import ANSWER
from np_drake.diagnosis.result import UNKNOWN

TRUTH = "truth.json"
COMPANION = "linear_drag"  # through which a wind is felt, and which is then named too
WINDS = ("constant_wind", "gusty_wind")


@dc.dataclass(frozen=True)
class Solved:
    """One case. truth, answer: the content of truth.json and diagnosis.json; answer None: there is none."""

    name: str
    truth: dict[str, Any]
    answer: dict[str, Any] | None

    @property
    def kind(self) -> str:
        """single | pair | triple | onset | clean | foreign."""
        return str(self.truth["kind"])

    @property
    def group(self) -> str:
        """Simulator and quality, as `drake, real`."""
        return f"{self.truth['simulator']}, {self.truth['quality']}"

    @property
    def visibility(self) -> float:
        """Largest ratio of a channel's RMS to its noise [1]."""
        return float(self.truth["visibility"])

    @property
    def felt_in_training(self) -> float:
        """The same in the flights of the fit, the most of them; 0 where the truth does not say [1]."""
        return max(self.truth.get("visibility_in_training", {}).values(), default=0.0)

    def visibility_in(self, flight: str) -> float:
        """The same in one flight; that of the case where the truth does not say [1]."""
        return float(self.truth.get("visibility_in_training", {}).get(flight, self.visibility))

    @property
    def true_names(self) -> tuple[str, ...]:
        """Of all effects that act."""
        return tuple(effect["effect"] for effect in self.truth["effects"])

    @property
    def main(self) -> str:
        """What a case of one effect is about: the first, for a wind's drag comes after it; clean: `clean`."""
        if self.kind == "foreign":
            return "foreign"
        return next((n for n in self.true_names), "clean")

    @property
    def verdict(self) -> tuple[str, ...]:
        """All that is said to be missing, `unknown` among it; without an answer nothing."""
        return () if self.answer is None else tuple(self.answer["verdict"])

    @property
    def named(self) -> tuple[str, ...]:
        """The verdict without `unknown`."""
        return tuple(name for name in self.verdict if name != UNKNOWN)

    @property
    def causes(self) -> dict[str, dict[str, Any]]:
        """Causes of the answer by effect."""
        return {} if self.answer is None else {c["effect"]: c for c in self.answer["causes"]}


def read_solved(answers: Path, truth: Path) -> list[Solved]:
    """Every case that has a truth, sorted by name; of a folder of sets, `<set>/<case>`.

    Raises: ValueError: if there is no truth, or a file is no JSON or not what docs/reference/files.md says: one line
        with file, field and what it must be; OSError: if one cannot be read.
    """
    names = [file.parent.relative_to(truth) for file in sorted(truth.rglob(TRUTH)) if file.parent != truth]
    if not names:
        raise ValueError(f"{truth}: must hold <case>/{TRUTH}; got none.")
    return [_read_case(str(name), truth / name / TRUTH, answers / name / ANSWER) for name in names]


def _read_case(name: str, truth: Path, answer: Path) -> Solved:
    found = _read(answer, fault_of_answer) if answer.is_file() else None
    return Solved(name, _read(truth, fault_of_truth), found)


def _read(path: Path, fault_of: Callable[[dict[str, Any]], str | None]) -> dict[str, Any]:
    fault: str | None = "must hold a JSON object."
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(content, dict):
            fault = fault_of(content)
    except (ValueError, RecursionError):  # no JSON; too deep to be read or to be quoted
        pass
    if fault is not None:
        raise ValueError(f"{path}: {fault}")
    return content


def same_flight(name: str) -> str:
    """A flight's name without folder and suffix, for `train_1.csv` and `train_1` are the same."""
    base = name.rsplit("/", 1)[-1]
    for suffix in (".csv.gz", ".csv", ".parquet"):
        base = base.removesuffix(suffix)
    return base
