"""Laws of `np-drake reproduce estimation | sample-efficiency`, on arrays that are made here."""

import json
import shutil

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.performance.predictor_bench import synthetic_flight
from diagrams.prediction.estimation import METHODS
from np_drake.estimation.wrench_table import COLUMNS, PUBLISHED
from np_drake.logs.formats.neurobem_wrenches import RACE_TRACK, TESTS, TRAINING

STEMS = {name: stem for stem, name in TESTS.items()}
FLOWN = (
    "random points",
    "race track 1",
    "ellipse",
    "figure-8 1",
)  # two without a row of the published NP
OWN = "2021-03-01-10-00-00_seg_1"  # a flight that the table does not have


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Less than two seconds each."""
    folder = tmp_path_factory.mktemp("neurobem")
    (folder / "npy").mkdir()
    for k, stem in enumerate([TRAINING, *(STEMS[name] for name in FLOWN), f"merged_{OWN}"]):
        flight = synthetic_flight(700, k)
        np.save(folder / "npy" / f"{stem}.npy", np.hstack([flight.zeta, flight.chi]))
    return folder


def test_every_cell_of_the_paper_stands_beside_ours(folder, tmp_path, capsys):
    out, page = tmp_path / "table.json", tmp_path / "table.md"
    command = [
        "reproduce",
        "estimation",
        "--neurobem",
        str(folder),
        "--seed",
        "3",
        "--json",
        str(out),
    ]
    assert run([*command, "--markdown", str(page)]) == 0, capsys.readouterr().err
    captured, content = capsys.readouterr().out, json.loads(out.read_text())
    cells = {(line["row"], line["column"]): line for line in content["table"]}
    assert list(dict.fromkeys(flight for flight, _ in cells)) == [
        "figure-8 1",
        "race track 1",
        *FLOWN[::2],
        OWN,
    ]
    assert len(cells) == len(content["table"]) == 50
    for flight in FLOWN:
        rows = PUBLISHED[flight]
        for place, column in enumerate(COLUMNS):
            line = cells[flight, column]
            assert line["paper"] == (rows["NP"][place] if "NP" in rows else None)
            assert line["NeuroMHE"] == rows["NeuroMHE"][place]
            assert cells[OWN, column]["NeuroMHE"] is None
            assert {"ours", "ours_paper", "NeuroBEM", "persistence", "linear"} <= set(line)
    assert set(content["at_or_below_the_paper"]) == {"np: paper", "np", "persistence", "linear"}
    assert all(
        found["unstable"] == 0 for of in content["stability"].values() for found in of.values()
    )
    assert content["seed"] == content["config"]["paper"]["seed"] == 3
    assert "seed 3, trained on the training segment; " in captured
    assert "of 20 cells" in captured
    assert "paper: 0 of " in captured
    for method in METHODS:
        assert f"| {method} |" in page.read_text()


def test_error_against_samples_needs_a_thousand(folder, capsys):
    """A thousand samples are the least that the paper trains on."""
    assert run(["reproduce", "sample-efficiency", "--neurobem", str(folder)]) == 2
    assert "must have 1000 samples; got 700." in capsys.readouterr().err


BAD = {  # arguments: what the line must say
    "no flights": (["estimation"], "estimation: give the folder"),
    "no folder": (["estimation", "--neurobem", "nowhere"], "nowhere"),
    "too short for the figure": (
        ["estimation", "--neurobem", "FOLDER", "--out", "OUT"],
        "must reach from 45 s",
    ),
    "no race track": (["sample-efficiency", "--neurobem", "OTHERS"], "must hold race track 1"),
    "out is a file": (
        ["sample-efficiency", "--neurobem", "FOLDER", "--out", "FILE"],
        "must be a folder",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_leaves_nothing(folder, tmp_path, monkeypatch, capsys, case):
    monkeypatch.delenv("NP_DRAKE_NEUROBEM", raising=False)
    file = tmp_path / "file"
    file.touch()
    (tmp_path / "others" / "npy").mkdir(parents=True)
    for path in (folder / "npy").glob("*.npy"):
        if path.stem != RACE_TRACK:
            shutil.copy(path, tmp_path / "others" / "npy")
    words = {
        "FOLDER": str(folder),
        "OTHERS": str(tmp_path / "others"),
        "OUT": str(tmp_path / "out"),
        "FILE": str(file),
    }
    arguments, message = BAD[case]
    assert run(["reproduce", *(words.get(word, word) for word in arguments)]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith(f"np-drake reproduce {arguments[0]}: ")
    assert message in last
    assert sorted(tmp_path.iterdir()) == [file, tmp_path / "others"]
