"""Every failure is one line and an exit code; no input is overwritten."""

import os

import pytest
import typer

from diagrams.batch.failed_run import FailedRun
from diagrams.cli import outcome as dut
from diagrams.cli.main import run
from np_drake.files.interruption import Ended
from np_drake.logs import case_folder


def failing(error):
    """An application whose only verb raises."""
    app = typer.Typer()

    @app.command("verb")
    def verb() -> None:
        raise error

    app.callback()(lambda: None)
    return app


class Panic(BaseException):
    """What native code raises past every `except Exception`."""


@pytest.mark.parametrize(
    "error, code, line",
    [
        (ValueError("mass must be\npositive"), 2, "np-drake verb: mass must be positive\n"),
        (ValueError("verb: logs must differ."), 2, "np-drake verb: logs must differ.\n"),
        (FileNotFoundError(2, "No such file", "a.csv"), 2, "np-drake verb: a.csv: No such file.\n"),
        (
            OSError(28, "No space left"),
            2,
            "np-drake verb: writing: No space left. Free some room, or ",
        ),
        (FailedRun("the vehicle fell."), 1, "np-drake verb: the vehicle fell.\n"),
        (KeyboardInterrupt(), 130, "np-drake verb: interrupted.\n"),
        (
            MemoryError(),
            70,
            "np-drake verb: internal error: MemoryError: no message (test_outcome.py:",
        ),
        (
            RecursionError("deep"),
            70,
            "np-drake verb: internal error: RecursionError: deep (test_outcome.py:",
        ),
        (
            ZeroDivisionError("a\nb"),
            70,
            "np-drake verb: internal error: ZeroDivisionError: a b (test_outcome.py:",
        ),
        (
            EOFError("cut off"),
            70,
            "np-drake verb: internal error: EOFError: cut off (test_outcome.py:",
        ),
        (Panic("native"), 70, "np-drake verb: internal error: Panic: native. Please report it"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else "",
)
def test_every_failure_is_one_line_and_an_exit_code(capsys, error, code, line):
    assert dut.run_app(failing(error), ["verb"]) == code
    said = capsys.readouterr().err.removeprefix("\n")  # typer begins a new line at an EOFError
    assert said.startswith(line)
    assert said.count("\n") == 1
    assert ("report it" in said) == (code == dut.FAULT)


def test_a_signal_outlasts_the_exception_that_it_became(capsys, monkeypatch):
    monkeypatch.setattr(dut, "last_signal", lambda: 15)
    assert dut.run_app(failing(ImportError("half an import")), ["verb"]) == 143
    assert capsys.readouterr().err == "np-drake verb: ended by SIGTERM.\n"
    monkeypatch.setattr(dut, "last_signal", lambda: 2)
    assert dut.run_app(failing(Ended()), ["verb"]) == 130


@pytest.mark.parametrize("arguments", [["--debug", "verb"], ["verb", "--debug"]])
def test_the_traceback_is_printed_where_it_is_asked_for(capsys, arguments):
    assert dut.run_app(failing(ValueError("bad")), arguments) == 2
    said = capsys.readouterr().err
    assert said.startswith("Traceback (most recent call last):\n")
    assert said.endswith("np-drake verb: bad\n")


@pytest.mark.parametrize("option", ["--json", "--out", "--markdown"])
@pytest.mark.parametrize("link", ["itself", "symbolic", "hard"])
def test_an_output_is_no_input_by_any_name(logs, tmp_path, capsys, option, link):
    source = tmp_path / "log.csv"
    source.write_bytes(logs[0].read_bytes())
    target = tmp_path / ("m.safetensors" if option == "--out" else "other")
    if link == "symbolic":
        target.symlink_to(source)
    elif link == "hard":
        target.hardlink_to(source)
    elif option == "--out":
        source = source.rename(target)
    else:
        target = source
    verb = {"--json": "doctor", "--out": "train", "--markdown": "export"}[option]
    arguments = {
        "doctor": [str(source), "--json", str(target)],
        "train": [str(source), "--out", str(target)],
        "export": [
            str(source),
            "--format",
            "sdf",
            "--out",
            str(tmp_path / "x"),
            "--markdown",
            str(target),
        ],
    }[verb]
    before = source.read_bytes()
    assert run([verb, *arguments]) == 2
    assert "must not be a file that is read" in capsys.readouterr().err
    assert source.read_bytes() == before
    assert target.is_symlink() == (link == "symbolic")


def test_inputs_are_what_is_named_and_not_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a.csv", "b.yaml", "c.json", "d.csv"):
        (tmp_path / name).write_text("")
    line = [
        "fly",
        "a.csv",
        "--vehicle=b.yaml",
        "--json",
        "c.json",
        "--out=d.csv",
        "--seed",
        "3",
        "missing",
    ]
    assert sorted(path.name for path in dut.inputs_of(line)) == ["a.csv", "b.yaml"]


def test_the_files_of_case_folders_are_inputs(tmp_path):
    names = [case_folder.VEHICLE, f"{case_folder.TRAIN}1.csv", f"{case_folder.HELD_OUT}.csv.gz"]
    for folder in (tmp_path / "a", tmp_path / "set" / "b"):
        folder.mkdir(parents=True)
        for name in (*names, "diagnosis.json"):
            (folder / name).touch()
    line = ["diagnose", str(tmp_path / "a"), str(tmp_path / "set"), "--out", str(tmp_path / "a")]
    assert sorted(path.name for path in dut.inputs_of(line)) == sorted(2 * names)
    assert dut.inputs_of(["diagnose", "--out", str(tmp_path / "a")]) == []


@pytest.mark.parametrize("verb", [["diagnose"], ["challenge", "solve", "--out", "answers"]])
@pytest.mark.parametrize("name", ["vehicle.yaml", "train_1.csv", "heldout.csv"])
def test_a_file_of_a_case_is_no_output_and_nothing_is_begun(
    tmp_path, monkeypatch, capsys, verb, name
):
    monkeypatch.chdir(tmp_path)
    cases = tmp_path / "set" / "a"
    cases.mkdir(parents=True)
    for other in ("vehicle.yaml", "train_1.csv", "heldout.csv"):
        (cases / other).write_text("as it was")
    case = "set" if "solve" in verb else "set/a"
    assert run([*verb, case, "--json", f"set/a/{name}"]) == 2
    assert f"set/a/{name}: must not be a file that is read" in capsys.readouterr().err
    assert (cases / name).read_text() == "as it was"
    assert not (tmp_path / "answers").exists()


@pytest.mark.parametrize("verb", ["doctor", "import", "fly", "export", "evaluate"])
def test_every_verb_refuses_a_pipe_in_one_line(verb, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    os.mkfifo("endless")
    assert run([verb, "endless"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "endless: must be a file or a folder; got a named pipe" in line
