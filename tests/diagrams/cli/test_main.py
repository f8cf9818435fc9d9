"""Laws of the command line as a whole."""

import os
import subprocess
import sys

import pytest
import typer

from diagrams.batch.failed_run import FailedRun
from diagrams.cli import main as dut


def failing(error):
    """An application whose only verb raises."""
    app = typer.Typer()

    @app.command("verb")
    def verb() -> None:
        raise error

    app.callback()(lambda: None)
    return app


@pytest.mark.parametrize(
    "error, code, line",
    [
        (ValueError("mass must be\npositive"), 2, "np-drake verb: mass must be positive\n"),
        (ValueError("verb: logs must differ."), 2, "np-drake verb: logs must differ.\n"),
        (FileNotFoundError(2, "No such file", "a.csv"), 2, "np-drake verb: a.csv: No such file.\n"),
        (FailedRun("the vehicle fell."), 1, "np-drake verb: the vehicle fell.\n"),
        (KeyboardInterrupt(), 130, "np-drake verb: interrupted.\n"),
    ],
)
def test_an_expected_failure_is_one_line_and_an_exit_code(capsys, error, code, line):
    assert dut.run_app(failing(error), ["verb"]) == code
    assert capsys.readouterr().err == line


def test_a_fault_of_the_program_keeps_its_traceback():
    with pytest.raises(ZeroDivisionError):
        dut.run_app(failing(ZeroDivisionError("fault")), ["verb"])


def test_a_developer_can_ask_for_the_traceback(monkeypatch):
    monkeypatch.setenv("NP_DRAKE_TRACEBACK", "1")
    with pytest.raises(ValueError, match="bad"):
        dut.run_app(failing(ValueError("bad")), ["verb"])


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["fry"], "No such command 'fry'"),
        (["train", "a.csv"], "Missing option '--out'"),
        (["train", "--nonsense"], "No such option"),
        (["train", "a.csv", "--out", "m.safetensors", "--seed", "x"], "--seed"),
    ],
)
def test_a_wrong_command_line_is_one_line_and_exit_code_2(capsys, arguments, message):
    assert dut.run(arguments) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.err.count("\n") == 1


@pytest.mark.parametrize(
    "arguments, given",
    [
        (["train", "a.csv", "--out", ""], "'' behind --out"),
        (["train", "a.csv", "--out="], "--out= with nothing behind it"),
        (["train", ""], "'' behind train"),
        (["challenge", "solve", ""], "'' behind solve"),
        ([""], "'' behind np-drake"),
    ],
)
def test_an_empty_argument_is_not_the_current_folder(capsys, arguments, given):
    assert dut.run(arguments) == 2
    line = capsys.readouterr().err
    assert f": an argument must not be empty; got {given}. Name " in line
    assert line.count("\n") == 1


def test_the_program_says_its_version_and_its_verbs(capsys):
    assert dut.run(["--version"]) == 0
    assert capsys.readouterr().out.startswith("np-drake 0.")
    assert dut.run([]) == 0
    assert "train" in capsys.readouterr().out


def test_help_keeps_the_units_in_brackets(capsys):
    assert dut.run(["train", "--help"]) == 0
    assert "flight logs [s]" in " ".join(capsys.readouterr().out.split())


def test_startup_waits_for_no_large_library():
    slow = "{'torch', 'pydrake', 'scipy', 'matplotlib', 'numpy', 'jinja2'}"
    code = f"import sys, diagrams.cli.main; print(sorted({slow} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_line_names_the_verb_of_a_group(capsys):
    for verb in ("solve", "score"):
        assert dut.run(["challenge", verb]) == 2
        assert capsys.readouterr().err.startswith(f"np-drake challenge {verb}: Missing ")


def shell(*arguments, **variables):
    """`python -m np_drake` as a shell calls it, told which shell that is."""
    environment = {**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1", **variables}
    command = [sys.executable, "-m", "np_drake", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout


def test_the_shell_completes_a_verb():
    said = shell(_NP_DRAKE_COMPLETE="complete_bash", COMP_WORDS="np-drake re", COMP_CWORD="1")
    assert said.split() == ["reproduce"]


def test_the_completion_is_shown():
    assert "_NP_DRAKE_COMPLETE=complete_bash" in shell("--show-completion", "bash")


def test_the_completion_is_installed(tmp_path):
    assert "bash completion installed in" in shell("--install-completion", "bash", HOME=str(tmp_path))
    (script,) = tmp_path.glob(".bash_completions/*")
    assert "complete_bash" in script.read_text()
