"""Laws of the runner of the verbs."""

import json
from types import SimpleNamespace
from typing import Annotated

import pytest
import typer

from diagrams.batch.run import FailedRun
from diagrams.cli import verb as output
from diagrams.cli.app import run_app
from diagrams.cli.main import run
from diagrams.cli.verb import Report, Run, noted, reports
from np_drake.files.file_access import lock_outputs, write_text

TABLE = ("a title", ["what", "value"], [("one | two", 1.23456)])


def made(change=lambda run: {}, **settings):
    """An application whose verb `make` reports `TABLE`, and the runs that reached its body."""
    seen: list[Run] = []

    @reports("made", **{"seed": 7, "out": output.OUT, **settings})
    def make(run: Run, size: Annotated[int, typer.Option(help="Size [m].")] = 3) -> Report:
        """Make a table."""
        seen.append(run)
        return Report([TABLE], config={"size": size}, metrics={"table": [1]}, **change(run))

    app = typer.Typer(rich_markup_mode=None)
    app.command("make")(make)
    app.callback()(lambda: None)
    return app, seen


def call(app, *arguments):
    return run_app(app, ["make", *map(str, arguments)])


def test_the_metrics_begin_with_schema_version_seed_and_configuration(tmp_path):
    app, _ = made()
    assert call(app, "--json", tmp_path / "m.json", "--size", 5) == 0
    content = json.loads((tmp_path / "m.json").read_text())
    assert list(content) == ["schema", "version", "seed", "config", "table"]
    assert (content["schema"], content["seed"], content["config"]) == (
        "np_drake.made/1",
        7,
        {"size": 5},
    )


def test_lines_stand_above_the_table_and_notes_below(tmp_path, capsys):
    app, _ = made(lambda run: {"lines": ["above"], "summary": ["below"], "notes": ["last"]})
    page = tmp_path / "page.md"
    assert call(app, "--markdown", page) == 0
    said = capsys.readouterr().out
    places = [said.index(text) for text in ("above", "a title", "below", "last", "table: ")]
    assert places == sorted(places)
    expected = "a title:\n\n| what | value |\n|---|---|\n| one \\| two | 1.23 |\n\n- below\n"
    assert page.read_text() == expected


def test_warnings_stand_once_behind_all_else(tmp_path, capsys):
    app, _ = made(lambda run: {"lines": ["above"], "notes": ["last"], "warnings": ["dull", "late"]})
    assert call(app) == 0
    said = capsys.readouterr().out
    assert said.endswith("last\nwarnings\n- dull\n- late\n\n")
    assert said.count("dull") == 1


def test_what_readers_say_of_several_logs_is_one_line():
    logs = [SimpleNamespace(name=name, notes=["no velocity"]) for name in ("a", "b")]
    assert noted(logs, ["b: left out"]) == ["a, b: no velocity", "b: left out"]


@pytest.mark.parametrize("option", ["--json", "--markdown", "--out"])
def test_a_file_that_cannot_be_written_is_refused_before_the_body_runs(option, tmp_path, capsys):
    app, seen = made()
    (tmp_path / "file").touch()
    assert call(app, option, tmp_path / "file" / "below") == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert seen == []
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("option", ["--json", "--markdown"])
@pytest.mark.parametrize("written_by", ["body", "report"])
def test_an_option_may_not_name_a_file_that_the_verb_writes(option, written_by, tmp_path, capsys):
    def write(folder):
        write_text(folder / "log.csv", "the log")

    def content(run):
        if written_by == "report":
            return {"write": write}
        write(run.folder)
        return {}

    app, _ = made(content)
    (tmp_path / "out").mkdir()
    assert (
        call(app, "--out", tmp_path / "out", option, tmp_path / "out" / ".." / "out" / "log.csv")
        == 2
    )
    said = capsys.readouterr().err
    assert "a file that this verb writes itself" in said
    assert len(said.splitlines()) == 1
    assert (tmp_path / "out" / "log.csv").read_text() == "the log"


def test_a_failure_comes_last(tmp_path, capsys):
    app, _ = made(lambda run: {"failure": FailedRun("it diverged.")})
    assert call(app, "--json", tmp_path / "m.json") == 1
    captured = capsys.readouterr()
    assert "a title" in captured.out
    assert captured.err == "np-drake make: it diverged.\n"
    assert (tmp_path / "m.json").exists()


def test_the_seed_of_a_verb_without_a_draw_is_accepted_and_hidden(capsys):
    app, seen = made(seed=None)
    assert call(app, "--seed", 3) == 0
    assert call(app) == 0
    assert [run.seed for run in seen] == [3, 0]
    assert call(app, "--help") == 0
    assert "--seed" not in capsys.readouterr().out.split("Usage")[1]


@pytest.mark.parametrize("there", [False, True], ids=["a new folder", "a folder with results"])
@pytest.mark.parametrize("many", [False, True])
def test_a_run_that_fails_leaves_nothing_of_its_own_but_cases(tmp_path, there, many):
    out = tmp_path / "out"
    if there:
        out.mkdir()
        (out / "kept.csv").write_text("1")

    def change(run):
        (run.out / "cases").mkdir()
        write_text(run.out / "cases" / "a.json", "{}")
        write_text(run.out / "half.html", "<")
        raise ValueError("the rest is missing.")

    app, _ = made(change, many=many)
    assert call(app, "--out", out) == 2
    found = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*"))
    kept = ["out", "out/kept.csv"] if there else []
    own = ["out", "out/cases", "out/cases/a.json", "out/half.html"]
    assert found == sorted({*kept, *(own if many else [])})


def test_what_others_write_meanwhile_stays(tmp_path):
    def change(run):
        write_text(run.out / "half.html", "<")
        (run.out / "notes.txt").write_text("of somebody else")
        raise ValueError("the rest is missing.")

    app, _ = made(change)
    assert call(app, "--out", tmp_path / "out") == 2
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["notes.txt"]


@pytest.mark.parametrize(
    ("words", "folder"),
    [
        ("vehicle new --preset crazyflie --out", False),
        ("challenge make --clean 1 --cases 0 --out own --truth", True),
        ("fly hover --duration 0.2 --mcap", False),
        ("fly hover --duration 0.2 --out", True),
    ],
)
def test_an_output_that_another_run_holds_is_refused_before_any_work(
    tmp_path, monkeypatch, capsys, words, folder
):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "own.mcap"
    with lock_outputs([path] if folder else [], [] if folder else [path]):
        before = set(tmp_path.rglob("*"))
        assert run([*words.split(), path.name]) == 2
        assert "another run" in capsys.readouterr().err
        assert set(tmp_path.rglob("*")) == before
    assert not set(tmp_path.rglob(".*lock"))


def test_a_table_fits_a_hundred_columns(capsys):
    rows = [("a flight with a rather long name indeed " * 3, "np", 0.02, 1.23456, None, 3)] * 2
    output.print_table(
        "skill", ["flight", "model", "horizon [s]", "force [N]", "torque [N·m]", "n"], rows
    )
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 100
    assert any("1.23 " in line for line in lines)
    assert any("–" in line for line in lines)


def test_two_outputs_are_never_one_file(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "a")
    for other in (tmp_path / "a", tmp_path / "." / "a", tmp_path / "link"):
        with pytest.raises(ValueError, match="two files are to be written there"):
            output.require_outputs(tmp_path / "a", other)
    output.require_outputs(tmp_path / "a", tmp_path / "b")
    assert [path.name for path in tmp_path.iterdir()] == ["link"]


@pytest.mark.parametrize("target", ["link", "nowhere"])
def test_a_link_to_nothing_is_no_folder(target, tmp_path):
    (tmp_path / "link").symlink_to(target)
    with pytest.raises(NotADirectoryError, match="must be a folder"):
        output.require_outputs(folders=[tmp_path / "link" / "sub"])


def test_off_a_terminal_progress_leaves_no_line_beside_that_of_an_error(capsys):
    def work():
        with output.progress("before", 1.0) as advance:
            advance(1.0)
        with output.progress("work", 2.0) as advance:
            advance(1.0)
            raise ValueError("bad")

    with pytest.raises(ValueError, match="bad"):
        work()
    assert capsys.readouterr().err == ""
