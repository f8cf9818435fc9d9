"""Laws of answers: what is written is read again, and what is none is named in one line."""

import json
from pathlib import Path

import pytest

from diagrams.challenge.real.answers import (
    brief,
    effects_of,
    read_answer,
    require_answers,
    write_answers,
)
from diagrams.challenge.real.rules import Case
from np_drake.effects.suspended_payload import SuspendedPayload

CASE = Case("payload", "06-10 + 17-21 -> 43-48", (Path("a"), Path("b")), Path("c"))
DRAG = {"effect": "linear_drag", "probability": 0.9}


def put(folder: Path, content: str, case: Case = CASE) -> Path:
    file = folder / case.folder / "diagnosis.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(content)
    return file


def test_the_folder_of_a_case_is_of_plain_letters():
    assert CASE.folder == Path("payload") / "06-10+17-21_to_43-48"


def test_what_is_written_is_read_again(tmp_path):
    answer = {
        "causes": [
            {**DRAG, "parameters": {"x": {"value": 0.1, "ci95": [0.0, None]}}, "onset": {"a": None}}
        ]
    }
    write_answers(tmp_path, {CASE.folder: answer})
    assert read_answer(tmp_path, CASE) == answer
    assert read_answer(tmp_path / "nowhere", CASE) is None


def test_only_what_is_scored_is_kept_of_an_answer():
    whole = {
        "causes": [DRAG],
        "gap": {"force": {}, "bands": [1, 2]},
        "refit": None,
        "readings": {},
        "wall": 2.0,
    }
    assert brief(whole) == {"causes": [DRAG], "gap": {"force": {}}, "refit": None, "wall": 2.0}


@pytest.mark.parametrize(
    "content, said",
    [
        ("{", "must hold a JSON object"),
        ("[]", "must hold a JSON object"),
        ("{}", "causes is missing"),
        (json.dumps({"causes": [{"effect": "linear_drag"}]}), "causes[0].probability is missing"),
        (json.dumps({"causes": [{**DRAG, "probability": 1.5}]}), "causes[0].probability must be"),
        (json.dumps({"causes": [], "wall": "long"}), "wall must be"),
    ],
)
def test_what_is_no_answer_is_said_with_file_and_field(content, said, tmp_path):
    file = put(tmp_path, content)
    with pytest.raises(ValueError, match=r"diagnosis\.json") as error:
        read_answer(tmp_path, CASE)
    assert str(error.value).startswith(f"{file}: ")
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_cases_without_an_answer_are_counted_and_none_at_all_is_refused(tmp_path):
    other = Case("bare", "x", (Path("a"),), Path("c"))
    with pytest.raises(ValueError, match=r"previous: .* must hold <group>/<case>/diagnosis\.json"):
        require_answers("previous", tmp_path, [CASE, other])
    put(tmp_path, json.dumps({"causes": []}))
    assert require_answers("previous", tmp_path, [CASE]) == []
    (line,) = require_answers("previous", tmp_path, [CASE, other])
    assert "1 of 2" in line
    assert "bare/x/diagnosis.json" in line


def test_effects_have_the_values_of_an_answer_and_unknown_ones_are_out():
    parameters = {"mass": {"value": 0.01}, "length": {"value": 0.5}, "colour": {"value": 3.0}}
    causes = [
        {"effect": "suspended_payload", "parameters": parameters},
        {"effect": "vortex_ring"},
        DRAG,
    ]
    (payload,) = effects_of({"causes": causes}, ["suspended_payload", "vortex_ring"])
    assert payload == SuspendedPayload(mass=0.01, length=0.5)
