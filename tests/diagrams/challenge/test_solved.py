import json
import shutil

import pytest

from diagrams.challenge.solved import read_solved, same_flight


@pytest.fixture
def folders(by_hand, tmp_path):
    truths = {"a1": by_hand.make_truth(by_hand.SCALE), "b2": by_hand.make_truth(kind="clean")}
    for name, truth in truths.items():
        (tmp_path / "truth" / name).mkdir(parents=True)
        (tmp_path / "truth" / name / "truth.json").write_text(json.dumps(truth))
    (tmp_path / "answers" / "a1").mkdir(parents=True)
    (tmp_path / "answers" / "a1" / "diagnosis.json").write_text(json.dumps(by_hand.perfect(truths["a1"])))
    return tmp_path / "answers", tmp_path / "truth"


def test_every_truth_is_a_case_with_or_without_an_answer(folders):
    first, second = read_solved(*folders)
    assert (first.name, first.main, first.verdict) == ("a1", "thrust_scale", ("thrust_scale",))
    assert (second.name, second.main, second.answer, second.verdict) == ("b2", "clean", None, ())
    assert first.group == "drake, clean"


def test_a_folder_of_sets_is_read_as_all_their_cases(folders, tmp_path):
    sets = [tmp_path / kind for kind in ("answers", "truths")]
    for whole, part in zip(sets, folders, strict=True):
        for name in ("one", "two"):
            shutil.copytree(part, whole / name)
    alone, together = read_solved(*folders), read_solved(*sets)
    assert [c.name for c in together] == [f"{s}/{c.name}" for s in ("one", "two") for c in alone]
    assert [c.verdict for c in together] == 2 * [c.verdict for c in alone]


def test_a_folder_without_truth_is_refused(folders, tmp_path):
    with pytest.raises(ValueError, match=r"must hold <case>/truth\.json"):
        read_solved(folders[0], folders[0])


def test_a_broken_file_is_named(folders):
    answers, truth = folders
    (answers / "a1" / "diagnosis.json").write_text("{")
    with pytest.raises(ValueError, match=r"a1/diagnosis\.json: must hold a JSON object"):
        read_solved(answers, truth)


def test_a_flight_is_the_same_by_any_suffix():
    assert {same_flight(n) for n in ("train_1", "train_1.csv", "x/train_1.csv.gz", "train_1.parquet")} == {
        "train_1"
    }


@pytest.mark.parametrize(
    "content, said",
    [("[]", "must hold a JSON object"), ("{}", "verdict is missing"), ('{"verdict": 3}', "verdict")],
)
def test_a_file_that_is_no_diagnosis_is_named(folders, content, said):
    answers, truth = folders
    (answers / "a1" / "diagnosis.json").write_text(content)
    with pytest.raises(ValueError, match=rf"a1/diagnosis\.json: {said}"):
        read_solved(answers, truth)
