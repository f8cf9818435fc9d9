"""Answers and truths made by hand, whose score can be counted."""

import copy
import json
from pathlib import Path
from typing import Any

from diagrams.evidence.challenge.answers import AnsweredCase

FLOOR = {"force": 0.2, "torque": 0.02}  # that the true model leaves in every channel [N, N·m]
SCALE = {"effect": "thrust_scale", "parameters": {"scale": 0.9}}
DRAG = {"effect": "linear_drag", "parameters": {"d_x": 0.3, "d_y": 0.4, "d_z": 0.0}}
WIND = {"effect": "constant_wind", "parameters": {"x": 3.0, "y": 0.0, "z": 0.0}}
PAYLOAD = {
    "effect": "suspended_payload",
    "parameters": {"mass": 0.2, "length": 0.8, "hook_x": 0.0, "hook_y": 0.0, "hook_z": -0.02},
}
WEAK = {"effect": "weak_rotor", "parameters": {"rotor": 2.0, "efficiency": 0.8}}
OUT_OF_LIBRARY = {"effect": "fan_jet", "parameters": {"reach": 0.7}}


def make_truth(
    *effects: dict[str, Any], kind: str = "single", visibility: float = 5.0, **other: Any
) -> dict:
    """The content of truth.json."""
    return {
        "effects": [
            {"onset": {"train_1.csv": None}, **copy.deepcopy(effect)} for effect in effects
        ],
        "class": [[effect["effect"]] for effect in effects],
        "true_model_residual": {f"{kind}_{axis}": FLOOR[kind] for kind in FLOOR for axis in "xyz"},
        "visibility": visibility,
        "simulator": "drake",
        "quality": "clean",
        "kind": kind,
        "seed": 3,
        **other,
    }


def make_cause(
    name: str, parameters: dict[str, float], *alike: str, probability: float = 1.0
) -> dict:
    """One cause, with an interval of a tenth of a unit to either side of every figure."""
    return {
        "effect": name,
        "probability": probability,
        "parameters": {
            key: {"value": value, "unit": "", "ci95": [value - 0.1, value + 0.1]}
            for key, value in parameters.items()
        },
        "onset": {"train_1": None},
        "indistinguishable_from": list(alike),
    }


def make_answer(
    *causes: dict[str, Any], unknown: bool = False, before: float = 3.0, after: float = 1.0
) -> dict:
    """The content of diagnosis.json. before, after: every wrench channel in units of its floor."""
    gap = {
        kind: {axis: {"rms": before * floor, "after": after * floor} for axis in "xyz"}
        for kind, floor in FLOOR.items()
    }
    return {
        "verdict": [cause["effect"] for cause in causes] + ["unknown"] * unknown,
        "causes": list(causes),
        "gap": gap,
        "shrink": {"replay": None},
        "wall": 2.0,
    }


def perfect(truth: dict[str, Any]) -> dict[str, Any]:
    """The answer that says what the truth says."""
    if truth["kind"] == "foreign":
        return make_answer(unknown=True)
    causes = []
    for effect in truth["effects"]:
        cause = make_cause(effect["effect"], effect["parameters"])
        cause["onset"] = {flight.removesuffix(".csv"): t for flight, t in effect["onset"].items()}
        causes.append(cause)
    return make_answer(*causes)


def make_case(
    truth: dict[str, Any], answer: dict[str, Any] | None, name: str = "case"
) -> AnsweredCase:
    """The two together."""
    return AnsweredCase(name, truth, answer)


def again(case: AnsweredCase, **changes: Any) -> AnsweredCase:
    """The case with another name, truth, answer or least visibility."""
    own = {key: getattr(case, key) for key in ("name", "truth", "answer", "least")}
    return AnsweredCase(**own | changes)


def named(
    truth: dict[str, Any], *names: str, alike: tuple[str, ...] = (), unknown: bool = False
) -> AnsweredCase:
    """A case that is answered with these names, each with the same `indistinguishable_from`."""
    return make_case(
        truth, make_answer(*(make_cause(n, {}, *alike) for n in names), unknown=unknown)
    )


def perfect_set() -> list[AnsweredCase]:
    """One of every kind, and ten singles, each with the answer that says what the truth says."""
    begun = {**SCALE, "onset": {"train_1.csv": 8.0, "train_2.csv": None}}
    truths = [make_truth(SCALE, visibility=1.5 + k) for k in range(10)]
    truths += [
        make_truth(WIND, DRAG),
        make_truth(PAYLOAD),
        make_truth(WEAK),
        make_truth(begun, kind="onset"),
        make_truth(SCALE, DRAG, kind="pair"),
        make_truth(SCALE, DRAG, WEAK, kind="triple"),
        make_truth(kind="clean", visibility=1.0),
        make_truth(OUT_OF_LIBRARY, kind="foreign"),
    ]
    return [make_case(truth, perfect(truth), f"case {k}") for k, truth in enumerate(truths)]


def write(folder: Path, truths: dict[str, Any], answers: dict[str, Any]) -> tuple[Path, Path]:
    """Write truths and answers by case; return the folders of answers and of truths."""
    for kind, file, every in (("truth", "truth", truths), ("answers", "diagnosis", answers)):
        for name, content in every.items():
            (folder / kind / name).mkdir(parents=True)
            (folder / kind / name / f"{file}.json").write_text(json.dumps(content))
    return folder / "answers", folder / "truth"


class Answered:
    """Stands for a diagnosis with one answer."""

    refit = None

    def __init__(self, train, held_out, vehicle, replay):
        self.content = {"train": [log.name for log in train], "replay": replay is not None}

    def as_json(self):
        return self.content
