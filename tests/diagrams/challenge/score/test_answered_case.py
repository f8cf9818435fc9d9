import json
import shutil

import pytest

from diagrams.challenge.score.answered_case import read_answered_cases
from diagrams.challenge.score.estimates import same_flight
from diagrams.challenge.score.score import score


@pytest.fixture
def folders(by_hand, tmp_path):
    truths = {"a1": by_hand.make_truth(by_hand.SCALE), "b2": by_hand.make_truth(kind="clean")}
    for name, truth in truths.items():
        (tmp_path / "truth" / name).mkdir(parents=True)
        (tmp_path / "truth" / name / "truth.json").write_text(json.dumps(truth))
    (tmp_path / "answers" / "a1").mkdir(parents=True)
    (tmp_path / "answers" / "a1" / "diagnosis.json").write_text(
        json.dumps(by_hand.perfect(truths["a1"]))
    )
    return tmp_path / "answers", tmp_path / "truth"


def test_every_truth_is_a_case_with_or_without_an_answer(folders):
    first, second = read_answered_cases(*folders)
    assert (first.name, first.main, first.verdict) == ("a1", "thrust_scale", ("thrust_scale",))
    assert (second.name, second.main, second.answer, second.verdict) == ("b2", "clean", None, ())
    assert first.group == "drake, clean"


def test_a_folder_of_sets_is_read_as_all_their_cases(folders, tmp_path):
    sets = [tmp_path / kind for kind in ("answers", "truths")]
    for whole, part in zip(sets, folders, strict=True):
        for name in ("one", "two"):
            shutil.copytree(part, whole / name)
    alone, together = read_answered_cases(*folders), read_answered_cases(*sets)
    assert [c.name for c in together] == [f"{s}/{c.name}" for s in ("one", "two") for c in alone]
    assert [c.verdict for c in together] == 2 * [c.verdict for c in alone]


def test_a_folder_without_truth_is_refused(folders, tmp_path):
    with pytest.raises(ValueError, match=r"must hold <case>/truth\.json"):
        read_answered_cases(folders[0], folders[0])


def test_a_broken_file_is_named(folders):
    answers, truth = folders
    (answers / "a1" / "diagnosis.json").write_text("{")
    with pytest.raises(ValueError, match=r"a1/diagnosis\.json: must hold a JSON object"):
        read_answered_cases(answers, truth)


def test_a_flight_is_the_same_by_any_suffix():
    assert {
        same_flight(n) for n in ("train_1", "train_1.csv", "x/train_1.csv.gz", "train_1.parquet")
    } == {"train_1"}


@pytest.mark.parametrize(
    "content, said",
    [
        ("[]", "must hold a JSON object"),
        ("{}", "verdict is missing"),
        ('{"verdict": 3}', "verdict"),
    ],
)
def test_a_file_that_is_no_diagnosis_is_named(folders, content, said):
    answers, truth = folders
    (answers / "a1" / "diagnosis.json").write_text(content)
    with pytest.raises(ValueError, match=rf"a1/diagnosis\.json: {said}"):
        read_answered_cases(answers, truth)


def spoilt(path, place, value):
    """Sets one field of a JSON file; `...` takes it out."""
    content = json.loads(path.read_text())
    inner = content
    for key in place[:-1]:
        inner = inner[key]
    if value is ...:
        del inner[place[-1]]
    else:
        inner[place[-1]] = value
    path.write_text(json.dumps(content))
    return content


EFFECT = {"effect": "thrust_scale", "parameters": {"scale": 0.9}}
TRUTHS = [
    (["effects"], [1], r"effects\[0\] must be an object with effect, parameters, onset; got 1\."),
    (["effects"], ["linear_drag"], r"effects\[0\] must be an object with .*; got 'linear_drag'\."),
    (["effects"], [{}], r"effects\[0\]\.effect is missing; it must be text\."),
    (
        ["effects"],
        [{"effect": "linear_drag"}],
        r"effects\[0\]\.parameters is missing; it must be an object",
    ),
    (["effects"], [], "effects must name what acts in a case of kind single; got 0"),
    (["effects"], [EFFECT, EFFECT], "class must hold a list for each of 2 effects; got 1"),
    (
        ["effects", 0, "effect"],
        "warp",
        r"effects\[0\]\.effect must be an effect of the library; got 'warp'",
    ),
    (
        ["effects", 0, "parameters"],
        [1],
        r"effects\[0\]\.parameters must be an object, .*; got \[1\]\.",
    ),
    (
        ["effects", 0, "parameters", "scale"],
        "a",
        r"parameters\.scale must be a finite number; got 'a'\.",
    ),
    (
        ["effects", 0, "onset"],
        {"train_1.csv": "x"},
        r"onset\.train_1\.csv must be a finite number, or null; got",
    ),
    (["class"], [], "class must hold a list for each of 1 effects; got 0"),
    (["class"], [1], r"class\[0\] must be a list, each text; got 1\."),
    (["class"], ["a", "b"], r"class\[0\] must be a list, each text; got 'a'\."),
    (["class"], [["a"]], r"class\[0\] must hold effects of the library; got 'a'\."),
    (
        ["true_model_residual"],
        {},
        "true_model_residual.force_x is missing; it must be a finite number, at least 0",
    ),
    (["true_model_residual"], {"force_x": 1}, "true_model_residual.force_y is missing"),
    (
        ["true_model_residual", "force_x"],
        "a",
        "true_model_residual.force_x must be a finite number, at least 0; got",
    ),
    (
        ["parameters_residual"],
        [1],
        "parameters_residual must be an object with force_x, .*, or null; got",
    ),
    (["visibility"], float("nan"), "visibility must be a finite number, at least 0; got nan"),
    (["within_tolerance"], [1], r"within_tolerance\[0\] must be true or false; got 1"),
    (["within_tolerance"], [], "within_tolerance must hold a flag for each of 1 effects; got 0"),
    (["visibility"], -1, "visibility must be a finite number, at least 0; got -1"),
    (["visibility"], True, "visibility must be a finite number, at least 0; got True"),
    (["visibility"], 10**400, "visibility must be a finite number, at least 0; got 1000"),
    (
        ["visibility_in_training"],
        {"a": "b"},
        "visibility_in_training.a must be a finite number, at least 0; got 'b'",
    ),
    (["visibility_in_training"], None, "visibility_in_training must be an object, .*; got nothing"),
    (
        ["best_onset"],
        {"train_1.csv": "x"},
        r"best_onset\.train_1\.csv must be a finite number; got 'x'",
    ),
    (
        ["kind"],
        "weird",
        "kind must be one of single, pair, triple, onset, clean, foreign; got 'weird'",
    ),
    (["kind"], "clean", "effects must be empty in a case of kind clean; got 1"),
    (["kind"], ..., "kind is missing; it must be one of single, "),
    (["seed"], 1.5, "seed must be a whole number; got 1.5"),
    (["seed"], True, "seed must be a whole number; got True"),
    (["quality"], 3, "quality must be text; got 3"),
]
REPLAY = {"horizon": [0.5, 1.0], "before": {"position": [1.0, 2.0]}, "after": {"position": [1.0]}}
ANSWERS = [
    (["verdict"], [1], r"verdict\[0\] must be text; got 1"),
    (["verdict"], "linear_drag", "verdict must be a list, each text; got 'linear_drag'"),
    (["causes"], [1], r"causes\[0\] must be an object with effect, "),
    (["causes"], [{}], r"causes\[0\]\.effect is missing"),
    (["causes", 0, "parameters"], ..., r"causes\[0\]\.parameters is missing"),
    (
        ["causes", 0, "parameters"],
        None,
        r"causes\[0\]\.parameters must be an object, .*; got nothing",
    ),
    (
        ["causes", 0, "parameters"],
        {"x": None},
        r"parameters\.x must be an object with value, ci95; got nothing",
    ),
    (
        ["causes", 0, "parameters", "scale", "value"],
        "a",
        r"scale\.value must be a finite number, or null; got 'a'",
    ),
    (
        ["causes", 0, "parameters", "scale", "ci95"],
        [1],
        r"scale\.ci95 must be a list of 2, each .*; got \[1\]",
    ),
    (
        ["causes", 0, "onset"],
        None,
        r"causes\[0\]\.onset must be an object, each value a finite number, or null; got",
    ),
    (
        ["causes", 0, "onset"],
        {"train_1.csv": "a"},
        r"onset\.train_1\.csv must be a finite number, or null; got 'a'",
    ),
    (
        ["causes", 0, "indistinguishable_from"],
        None,
        "indistinguishable_from must be a list, each text; got nothing",
    ),
    (
        ["causes", 0, "indistinguishable_from"],
        "abc",
        "indistinguishable_from must be a list, each text; got 'abc'",
    ),
    (
        ["causes", 0, "probability"],
        2.0,
        "probability must be a finite number, at least 0 and at most 1, or null; got 2",
    ),
    (["gap"], {"force": [1]}, r"gap\.force must be an object with x, y, z; got \[1\]"),
    (
        ["gap", "force", "x", "rms"],
        "a",
        r"gap\.force\.x\.rms must be a finite number, at least 0, or null; got 'a'",
    ),
    (["shrink"], ..., "shrink is missing; it must be an object with replay"),
    (
        ["shrink", "replay"],
        {"before": None},
        r"shrink\.replay\.horizon is missing; it must be a list, each a finite",
    ),
    (
        ["shrink", "replay"],
        REPLAY,
        r"shrink\.replay\.after\.position must hold an error for each of 2 horizons; got 1",
    ),
    (["wall"], "x", "wall must be a finite number, at least 0, or null; got 'x'"),
]


@pytest.mark.parametrize(
    "file, place, value, said",
    [("truth", *row) for row in TRUTHS] + [("answers", *row) for row in ANSWERS],
)
def test_an_unreadable_field_is_one_line_with_file_field_and_remedy(
    folders, file, place, value, said
):
    answers, truth = folders
    path = {"truth": truth / "a1" / "truth.json", "answers": answers / "a1" / "diagnosis.json"}[
        file
    ]
    spoilt(path, place, value)
    with pytest.raises(ValueError, match=rf"a1/{path.name}: .*{said}") as caught:
        read_answered_cases(answers, truth)
    assert "\n" not in str(caught.value)


def test_what_a_truth_or_an_answer_may_leave_out_is_no_fault(folders):
    answers, truth = folders
    for place, value in (
        (["effects", 0, "onset"], ...),
        (["best_onset"], {}),
        (["parameters_residual"], None),
    ):
        spoilt(truth / "a1" / "truth.json", place, value)
    cause = ["causes", 0]
    left_out = (
        [*cause, "probability"],
        [*cause, "onset"],
        [*cause, "indistinguishable_from"],
        ["wall"],
    )
    for place in (*left_out, ["shrink", "replay"], ["gap", "torque"], ["gap", "force", "z"]):
        spoilt(answers / "a1" / "diagnosis.json", place, ...)
    cases = read_answered_cases(answers, truth)
    score(cases)
    assert cases[0].verdict == ("thrust_scale",)


def test_an_out_of_library_effect_may_have_any_name_and_figures(folders):
    answers, truth = folders
    spoilt(
        truth / "a1" / "truth.json",
        ["effects", 0],
        {"effect": "jet", "parameters": {"place": [1, 2]}},
    )
    spoilt(truth / "a1" / "truth.json", ["class"], [["jet"]])
    spoilt(truth / "a1" / "truth.json", ["kind"], "foreign")
    score(read_answered_cases(answers, truth))


def test_a_file_too_deep_to_read_is_named(folders):
    answers, truth = folders
    (answers / "a1" / "diagnosis.json").write_text("[" * 100_000)
    with pytest.raises(ValueError, match=r"a1/diagnosis\.json: must hold a JSON object"):
        read_answered_cases(answers, truth)


def test_a_value_too_deep_to_quote_is_one_line(folders):
    answers, truth = folders
    for depth in range(
        400, 1000
    ):  # what the stack takes: first read and quoted, then read alone, then neither
        (answers / "a1" / "diagnosis.json").write_text(
            f'{{"verdict": [{"[" * depth}{"]" * depth}]}}'
        )
        with pytest.raises(
            ValueError, match=r"a1/diagnosis\.json: (must hold a JSON object|verdict\[0\])"
        ):
            read_answered_cases(answers, truth)
