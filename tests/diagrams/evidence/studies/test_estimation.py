"""Laws of the estimation table and of the error against training samples, on arrays made here."""

import json

import numpy as np
import pytest

from diagrams.batch.run import Run
from diagrams.cli.main import run
from diagrams.evidence.studies import estimation as dut
from diagrams.evidence.studies.estimation import CHANNELS, column_rmse
from np_drake.lifting.model.lifted_model import MODE_DICTIONARY as NP
from np_drake.lifting.training.train import make_config, train
from np_drake.logs.formats.neurobem import TESTS, TRAINING

PUBLISHED = {name: rows.droplevel(0).T for name, rows in dut.PUBLISHED.groupby("flight")}
STEMS = {name: stem for stem, name in TESTS.items()}
FLOWN = ("random points", "ellipse")  # one without a row of the published NP
OWN = "2021-03-01-10-00-00_seg_1"  # a flight that the table does not have


@pytest.fixture(scope="module")
def folder(tmp_path_factory, synthetic_flight):
    """Less than two seconds each."""
    folder = tmp_path_factory.mktemp("neurobem")
    (folder / "npy").mkdir()
    for k, stem in enumerate([TRAINING, *(STEMS[name] for name in FLOWN), f"merged_{OWN}"]):
        flight = synthetic_flight(700, k)
        np.save(folder / "npy" / f"{stem}.npy", np.hstack([flight.zeta, flight.chi]))
    return folder


def test_lengths_are_of_the_error_vector_without_gaps():
    error = np.tile([3.0, -4.0, 12.0, 0.3, 0.4, -1.2], (7, 1))
    expected = [3.0, 4.0, 12.0, 0.3, 0.4, 1.2, 5.0, 0.5, 13.0, 1.3]
    assert list(column_rmse(error)) == list(CHANNELS)
    np.testing.assert_allclose(list(column_rmse(error).values()), expected)
    error[2, 5], error[2, :5] = np.nan, 100.0
    assert column_rmse(error)["F_x"] == pytest.approx(3.0)
    with pytest.raises(ValueError, match="must have a row"):
        column_rmse(np.full((3, 6), np.nan))


PRINTED_SO = {  # lengths that are printed otherwise than their components make them
    ("melon 2", "NeuroBEM", "tau"),
    ("ellipse", "NeuroBEM", "tau"),
    ("figure-8 4", "NeuroMHE", "tau"),
}


def test_published_lengths_follow_from_published_components():
    """To the rounding of three decimals: no figure is mistyped."""
    assert set(PUBLISHED) == set(TESTS.values())
    assert len([rows for rows in PUBLISHED.values() if "NP" in rows]) == 6
    for flight, rows in PUBLISHED.items():
        for method, row in rows.items():
            for kind in ("F", "tau"):
                x, y, z = (row[f"{kind}_{axis}"] for axis in "xyz")
                if (flight, method, kind) not in PRINTED_SO:
                    assert row[f"{kind}_xy"] == pytest.approx(np.hypot(x, y), abs=0.0015)
                    assert row[kind] == pytest.approx(np.hypot(np.hypot(x, y), z), abs=0.0015)


def test_every_cell_of_the_paper_stands_beside_ours(folder, tmp_path, capsys):
    out, page = tmp_path / "table.json", tmp_path / "table.md"
    given = ["--neurobem", str(folder), "--seed", "3", "--json", str(out), "--markdown", str(page)]
    assert run(["reproduce", "estimation", *given]) == 0, capsys.readouterr().err
    captured, content = capsys.readouterr().out, json.loads(out.read_text())
    cells = {(line["row"], line["column"]): line for line in content["table"]}
    assert len(cells) == len(content["table"]) == 30
    for flight in FLOWN:
        rows = PUBLISHED[flight]
        for column in CHANNELS:
            line = cells[flight, column]
            assert line["paper"] == (rows["NP"][column] if "NP" in rows else None)
            assert line["NeuroMHE"] == rows["NeuroMHE"][column]
            assert cells[OWN, column]["NeuroMHE"] is None
            assert {"ours", "ours_paper", "NeuroBEM", "persistence", "linear"} <= set(line)
    assert set(content["at_or_below_the_paper"]) == {"np: paper", NP, "persistence", "linear"}
    assert content["seed"] == content["config"]["paper"]["seed"] == 3
    assert "of 10 cells" in captured
    assert all(f"| {method} |" in page.read_text() for method in ("NeuroBEM", "NeuroMHE", "NP"))


SIZES = (600, 1200)


@pytest.mark.nightly
def test_every_model_and_size_has_its_point_beside_the_papers(synthetic_flight):
    training, test = synthetic_flight(1250, 0), synthetic_flight(700, 1)
    configs = {**dut.configs(seed=0), "paper": make_config("paper", epochs=1)}
    points = dut.sample_efficiency(Run(), training, test, configs, sizes=SIZES)
    sizes = {(p["samples"], p["pieces"]) for p in points if p["row"] == NP}
    assert sizes == {(600, 2), (1200, 1)}
    assert {p["row"] for p in points} == {"np: paper", NP, "persistence", "linear"}
    for p in points:
        for mean, low, high in (p["force"], p["torque"]):
            assert 0 < low <= mean <= high
    with pytest.raises(ValueError, match="must have 1300 samples; got 1250"):
        dut.sample_efficiency(Run(), training, test, configs, sizes=(1300,))


@pytest.mark.nightly
def test_one_step_ahead_the_default_is_below_the_paper_in_every_cell(neurobem):
    training, found = dut.flights(neurobem)
    tests = {name: flight for name, flight in found.items() if "NP" in PUBLISHED.get(name, {})}
    model = train([training], make_config(NP, frame="body")).model
    cells = dut.estimation_table(Run(), {NP: model}, tests, {})
    assert list(cells.index.unique(0)) == list(tests)
    assert dut.ratios(cells, NP).shape == (10 * len(tests),)
    assert dut.ratios(cells, NP).max() < 0.25
    assert dut.ratios(cells, "persistence").max() <= 1.0  # the floor, not the goal
