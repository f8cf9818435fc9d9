"""Laws of the command line as a whole."""

import os
import signal
import subprocess
import sys
import time

import pytest

from diagrams.cli import main as dut


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
    return subprocess.run(
        command, capture_output=True, text=True, check=True, env=environment
    ).stdout


def test_the_shell_completes_a_verb():
    said = shell(_NP_DRAKE_COMPLETE="complete_bash", COMP_WORDS="np-drake re", COMP_CWORD="1")
    assert said.split() == ["reproduce"]


def test_the_completion_is_shown():
    assert "_NP_DRAKE_COMPLETE=complete_bash" in shell("--show-completion", "bash")


def test_the_completion_is_installed(tmp_path):
    assert "bash completion installed in" in shell(
        "--install-completion", "bash", HOME=str(tmp_path)
    )
    (script,) = tmp_path.glob(".bash_completions/*")
    assert "complete_bash" in script.read_text()


def started(*arguments, code="", **variables):
    """A run in a process of its own, after some Python."""
    program = (
        f"import sys; sys.argv[1:] = {list(arguments)!r}\n{code}\nfrom diagrams.cli.main "
        f"import main; main()"
    )
    command, environment = [sys.executable, "-c", program], {**os.environ, **variables}
    return subprocess.run(command, capture_output=True, text=True, env=environment)


SIGNALS = {
    "SIGINT": (130, "interrupted."),
    "SIGTERM": (143, "ended by SIGTERM."),
    "SIGHUP": (129, "ended by SIGHUP."),
}


@pytest.mark.parametrize(
    "name, module",
    [("SIGINT", "typer"), ("SIGTERM", "rich.progress"), ("SIGHUP", "yaml"), ("SIGINT", "numpy")],
)
def test_a_signal_while_modules_are_imported_is_one_line(name, module):
    code, line = SIGNALS[name]
    dut = started("vehicle", "list", code=SENDS.format(name=name, module=module))
    assert dut.returncode == code
    assert dut.stderr.endswith(f": {line}\n")
    assert dut.stderr.count("\n") == 1


SENDS = """
import os, signal
class Sender:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.{name})
sys.meta_path.insert(0, Sender())
"""


@pytest.mark.parametrize("name", SIGNALS)
def test_a_signal_ends_a_run_and_leaves_no_half_file(tmp_path, name):
    arguments = ["fly", "hover", "--out", str(tmp_path / "out"), "--json", str(tmp_path / "m.json")]
    process = subprocess.Popen(
        [sys.executable, "-m", "np_drake", *arguments],
        stderr=subprocess.PIPE,
        text=True,
        stdout=subprocess.PIPE,
    )
    time.sleep(
        3.0
    )  # it flies by then [s]; where the machine is slow it still imports, under the same law
    process.send_signal(getattr(signal, name))
    _, said = process.communicate(timeout=60)
    code, line = SIGNALS[name]
    assert process.returncode == code
    assert said.splitlines()[-1].endswith(line)
    assert "Traceback" not in said
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]
