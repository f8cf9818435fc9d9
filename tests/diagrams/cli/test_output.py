"""Laws of what verbs print and write."""

import json

import numpy as np
import pytest

from diagrams.cli import output as dut


def test_a_table_fits_a_hundred_columns(capsys):
    rows = [("a flight with a rather long name indeed " * 3, "np", 0.02, 1.23456, None, 3)] * 2
    dut.print_table(
        "skill", ["flight", "model", "horizon [s]", "force [N]", "torque [N·m]", "n"], rows
    )
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 100
    assert any("1.23 " in line for line in lines)
    assert any("–" in line for line in lines)


def test_a_metrics_file_names_its_schema_version_and_seed(tmp_path):
    dut.write_metrics(
        tmp_path / "m.json", "fly", seed=3, config={"a": 1}, metrics={"E_z": np.float64(0.5)}
    )
    content = json.loads((tmp_path / "m.json").read_text())
    assert content["schema"] == "np_drake.fly/1"
    assert (content["seed"], content["config"], content["metrics"]) == (3, {"a": 1}, {"E_z": 0.5})
    assert content["version"].count(".") == 2


def test_two_outputs_are_never_one_file(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "a")
    for other in (tmp_path / "a", tmp_path / "." / "a", tmp_path / "link"):
        with pytest.raises(ValueError, match="two files are to be written there"):
            dut.require_outputs(tmp_path / "a", other)
    dut.require_outputs(tmp_path / "a", tmp_path / "b", None)
    assert [path.name for path in tmp_path.iterdir()] == ["link"]


def test_progress_ends_at_a_hundred_percent_where_a_person_looks(capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")  # what a terminal is for rich
    monkeypatch.setenv("TERM", "xterm")
    with dut.progress("working", 10) as advance:
        advance(5, "half")
        advance(10)
    err = capsys.readouterr().err
    assert "working" in err
    assert "100%" in err


def test_a_long_line_is_not_wrapped(capsys):
    dut.say("x" * 300, "[bold] is no markup")
    assert capsys.readouterr().out == "x" * 300 + "\n[bold] is no markup\n"


@pytest.mark.parametrize("target", ["link", "nowhere"])
def test_a_link_to_nothing_is_no_folder(target, tmp_path):
    (tmp_path / "link").symlink_to(target)
    with pytest.raises(NotADirectoryError, match="must be a folder"):
        dut.require_outputs(folders=[tmp_path / "link" / "sub"])


def test_off_a_terminal_progress_leaves_no_line_beside_that_of_an_error(capsys):
    def work():
        with dut.progress("before", 1.0) as advance:
            advance(1.0)
        with dut.progress("work", 2.0) as advance:
            advance(1.0)
            raise ValueError("bad")

    with pytest.raises(ValueError, match="bad"):
        work()
    assert capsys.readouterr().err == ""
