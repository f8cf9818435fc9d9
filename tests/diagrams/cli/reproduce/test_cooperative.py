"""Laws of `np-drake reproduce cooperative`, on flights of half a second."""

import json

import pytest

from diagrams.batch.failed_run import FailedRun
from diagrams.cli.main import run
from diagrams.cooperative import result
from diagrams.cooperative.config import load_cooperative


@pytest.fixture
def brief(monkeypatch, in_this_process):
    def scenario():
        config = load_cooperative()
        config.settle, config.hover, config.transport, config.rest, config.distance = 0.1, 0.1, 0.1, 0.1, 0.01
        return config

    monkeypatch.setattr(result, "load_cooperative", scenario)


def test_a_fleet_named_twice_has_its_rows_once(brief, tmp_path, capsys):
    out, page, folder = tmp_path / "table.json", tmp_path / "table.md", tmp_path / "out"
    command = [
        "reproduce",
        "cooperative",
        "--vehicles",
        "2",
        "--vehicles",
        "2",
        "--seed",
        "5",
        "--seeds",
        "1",
    ]
    assert run([*command, "--json", str(out), "--markdown", str(page), "--out", str(folder)]) == 0
    content, captured = json.loads(out.read_text()), capsys.readouterr().out
    lines = [(line["vehicles"], line["row"]) for line in content["table"]]
    assert lines == [(2, row) for row in result.ROWS]
    assert content["seed"] == 5
    assert content["config"]["vehicles"] == [2]
    assert "1 flights a row, seeds 5 … 5, sqp" in captured
    assert "2 vehicles, np, one frozen: " in captured
    assert page.read_text().count("| 2 | np, one at zero |") == 2
    for kind in ("*_paths.png", "*_replay.html"):
        assert len(list(folder.glob(kind))) == len(result.ROWS)


def test_a_lost_fleet_keeps_its_line_and_loses_no_other(brief, monkeypatch, tmp_path, capsys):
    real = result.simulate

    def collide(config, **options):
        if config.fault == "zero":
            raise FailedRun("two vehicles came within 0.10 m of each other.")
        return real(config, **options)

    monkeypatch.setattr(result, "simulate", collide)
    page = tmp_path / "table.md"
    rows = ["--only", "np, one at zero", "--only", "np, one frozen"]
    assert (
        run(["reproduce", "cooperative", "--vehicles", "1", *rows, "--seeds", "1", "--markdown", str(page)])
        == 0
    )
    assert "1 vehicles, np, one at zero: two vehicles came within 0.10 m" in capsys.readouterr().out
    assert "| 1 | np, one at zero | lost |" in page.read_text()
    assert page.read_text().count("| np, one frozen |") == 2


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["--vehicles", "9"], "vehicles must be 1 to 8; got 9."),
        (["--vehicles", "2", "--vehicles", "0"], "vehicles must be 1 to 8; got 0."),
        (
            ["--only", "oracle"],
            "must name rows of the table (nominal; hold; np; np, one at zero; np, one frozen)",
        ),
        (["--solver", "newton"], "newton"),
        (["--out", "FILE"], "must be a folder"),
    ],
)
def test_bad_input_is_one_line_before_any_flight(tmp_path, capsys, arguments, message):
    file = tmp_path / "file"
    file.touch()
    words = [str(file) if word == "FILE" else word for word in arguments]
    assert run(["reproduce", "cooperative", *words]) == 2
    assert message in capsys.readouterr().err.splitlines()[-1]
