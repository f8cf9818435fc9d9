import json

from diagrams.cli.main import run
from diagrams.evidence.challenge.out_of_library import HOLDOUT


def test_make_writes_a_set_and_its_figures(tmp_path, in_this_process):
    figures = tmp_path / "made.json"
    arguments = f"challenge make --out {tmp_path}/cases --truth {tmp_path}/truth".split()
    small = ["--cases", "1", "--clean", "1", "--seconds", "5", "--json", str(figures)]
    assert run([*arguments, *small]) == 0
    made = json.loads(figures.read_text())
    assert made["written"] == 2
    assert made["kinds"] == {"clean": 1, "single": 1}
    assert len(list((tmp_path / "cases").iterdir())) == 2


def test_unseen_kinds_are_flown_alone_where_they_are_asked_for(tmp_path, in_this_process):
    arguments = f"challenge make --out {tmp_path}/cases --truth {tmp_path}/truth".split()
    metrics = tmp_path / "make.json"
    small = ["--unseen", "--cases", "2", "--clean", "0", "--seconds", "5", "--seed", "3", "--json"]
    assert run([*arguments, *small, str(metrics)]) == 0
    truths = [json.loads(path.read_text()) for path in (tmp_path / "truth").glob("*/truth.json")]
    assert [truth["kind"] for truth in truths] == ["foreign", "foreign"]
    assert all(truth["effects"][0]["effect"] in HOLDOUT for truth in truths)
    assert json.loads(metrics.read_text())["config"]["unseen"] is True
