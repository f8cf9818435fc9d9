import dataclasses as dc
import json
import shutil
from contextlib import nullcontext

import pytest

from diagrams.batch.run import FailedRun
from diagrams.evidence.challenge import make as module
from diagrams.evidence.challenge.case import FILES, CaseDraw, SetRequest, case_name
from diagrams.evidence.challenge.make import check_request, make, make_case
from diagrams.evidence.challenge.truth import GroundTruth
from np_drake.logs.opening import open_flights
from np_drake.vehicle import load_vehicle

OPTIONS = {"simulator": "drake", "quality": "real", "seconds": 5.0, "seed": 3}
SIZE = {"cases": 2, "clean": 1}


@pytest.fixture(scope="module")
def small_set(tmp_path_factory):
    base = tmp_path_factory.mktemp("challenge")
    result = make(base / "cases", base / "truth", SetRequest(**SIZE, **OPTIONS))
    return base, result


def test_cases_can_be_read_and_have_a_truth_each(small_set):
    base, result = small_set
    names = sorted(folder.name for folder in (base / "cases").iterdir())
    assert result["written"] == len(names) == 3
    assert names == sorted(folder.name for folder in (base / "truth").iterdir())
    for name in names:
        vehicle = load_vehicle(base / "cases" / name / "vehicle.yaml")
        logs = [open_flights(base / "cases" / name / file, vehicle=vehicle)[0][0] for file in FILES]
        truth = json.loads((base / "truth" / name / "truth.json").read_text())
        assert len(truth["class"]) == len(truth["effects"])
        assert truth["visibility"] >= 0.9
        assert set(truth["visibility_in_training"]) == {"train_1.csv", "train_2.csv"}
        assert min(truth["visibility_in_training"].values()) >= 0.9
        assert set(truth["true_model_residual"]) >= {"force_x", "torque_z"}
        assert all(log.al is None for log in logs)
        if truth["kind"] == "clean":
            assert truth["effects"] == []


def test_names_and_sizes_give_nothing_away(small_set):
    base, _ = small_set
    for folder in (base / "cases").iterdir():
        assert sorted(path.name for path in folder.iterdir()) == sorted([*FILES, "vehicle.yaml"])
        assert len(folder.name) == 10
        assert int(folder.name, 16) >= 0
        text = (folder / "vehicle.yaml").read_text() + (folder / FILES[0]).read_text()[:400]
        assert not any(word in text for word in ("effect", "single", "clean", "seed"))


@pytest.mark.parametrize("truth", ["cases", "cases/truth", "."])
def test_the_truth_may_not_lie_with_the_cases(tmp_path, truth):
    with pytest.raises(ValueError, match="neither"):
        make(tmp_path / "cases", tmp_path / truth, SetRequest(cases=1, clean=0))
    assert not (tmp_path / "cases").exists()


@pytest.mark.parametrize(
    "wrong", [{"simulator": "gazebo"}, {"quality": "dirty"}, {"seconds": 0.1}, {"cases": 0}]
)
def test_impossible_requests_are_refused(tmp_path, wrong):
    with pytest.raises(ValueError, match="make"):
        make(tmp_path / "cases", tmp_path / "truth", SetRequest(clean=0, **wrong))
    assert list(tmp_path.iterdir()) == []


def test_a_set_is_not_mixed_with_another_but_may_be_made_again(tmp_path):
    mine = case_name(5, 0)
    for name, fine in ((mine, True), (case_name(6, 0), False), ("notes.txt", False)):
        for holder in ("cases", "truth"):
            folders = {n: tmp_path / f"{name}-{holder}" / n for n in ("cases", "truth")}
            (folders[holder] / name).mkdir(parents=True)
            expected = nullcontext() if fine else pytest.raises(ValueError, match="another set")
            with expected:
                check_request(SetRequest(seed=5, cases=2, clean=0), *folders.values())


def test_a_case_that_cannot_be_flown_leaves_nothing_behind(tmp_path, monkeypatch, in_this_process):
    def lost(case):
        raise FailedRun("lost")

    monkeypatch.setattr(module, "fly_case", lost)
    with pytest.raises(FailedRun, match="no draw"):
        make(tmp_path / "cases", tmp_path / "truth", SetRequest(cases=0, clean=1, **OPTIONS))
    assert [path.name for path in sorted(tmp_path.rglob("*"))] == ["cases", "truth"]


def test_an_interrupted_set_goes_on_and_ends_as_an_uninterrupted_one(small_set, tmp_path):
    """What is made again is the same to the byte: the seed decides."""
    base, result = small_set
    for kind in ("cases", "truth"):
        shutil.copytree(base / kind, tmp_path / kind)
    first, second, *others = sorted(folder.name for folder in (base / "cases").iterdir())
    shutil.rmtree(tmp_path / "cases" / first)
    shutil.rmtree(tmp_path / "truth" / second)
    (tmp_path / "cases" / f".{first}").mkdir()  # half a folder of a killed run
    kept = {n: (tmp_path / "cases" / n / FILES[0]).stat().st_mtime_ns for n in others}
    assert make(tmp_path / "cases", tmp_path / "truth", SetRequest(**SIZE, **OPTIONS)) == result
    for kind in ("cases", "truth"):
        files = sorted(path.relative_to(base / kind) for path in (base / kind).rglob("*"))
        assert files == sorted(
            path.relative_to(tmp_path / kind) for path in (tmp_path / kind).rglob("*")
        )
        for file in files:
            if (base / kind / file).is_file():
                assert (base / kind / file).read_bytes() == (tmp_path / kind / file).read_bytes()
    assert kept == {n: (tmp_path / "cases" / n / FILES[0]).stat().st_mtime_ns for n in others}


def test_without_rotorpy_the_remedy_is_said_before_any_work(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"pip install 'np_drake\[challenge\]'"):
        make(tmp_path / "cases", tmp_path / "truth", SetRequest("rotorpy", cases=1, clean=0))
    assert list(tmp_path.iterdir()) == []


def test_an_effect_that_a_library_effect_explains_is_drawn_again(monkeypatch):
    answers = iter([["mass_error"], []])
    monkeypatch.setattr(GroundTruth, "equivalent_library_effects", lambda _: next(answers))
    made = make_case(dc.asdict(CaseDraw(0, "foreign", ("wall_suction",))), SetRequest(**OPTIONS))
    assert made["truth"]["attempt"] == 1
