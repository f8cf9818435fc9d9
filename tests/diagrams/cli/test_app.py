"""Laws of the command line as a whole: one line and an exit code for every failure, no input is
overwritten, streams and signals.
"""

import json
import os
import signal
import subprocess
import sys
import time
import typing

import pytest
import typer

from diagrams.batch.run import FailedRun
from diagrams.cli import app as dut
from diagrams.cli.main import run
from np_drake.files.interruption import Ended

NP_DRAKE = f"{sys.executable} -m np_drake"
SIGNALS = {"SIGINT": (130, "interrupted."), "SIGTERM": (143, "ended by SIGTERM.")}


def commands(group=None):
    """Commands by the words that name them."""
    group = group or typer.main.get_command(dut.app)
    found = {}
    for name in group.list_commands(None):
        command = group.get_command(None, name)
        inner = commands(command) if hasattr(command, "list_commands") else {"": command}
        found |= {f"{name} {words}".strip(): one for words, one in inner.items()}
    return found


def shell(command, **variables):
    """What Bash runs."""
    environment = os.environ | variables
    return subprocess.run(["bash", "-c", command], capture_output=True, text=True, env=environment)


@pytest.mark.parametrize(
    "words, message",
    [
        ("fry", "No such command 'fry'"),
        ("train a.csv", "Missing option '--out'"),
        ("train a.csv --out m.safetensors --seed x", "--seed"),
        ("challenge score", "np-drake challenge score: Missing"),
        ("bench --markdown --help", "--markdown: must be followed by a file or a folder; got"),
        ("train a.csv --out=", "an argument must not be empty; got '--out=' behind a.csv"),
    ],
)
def test_a_wrong_command_line_is_one_line_and_exit_code_2(capsys, words, message):
    assert run(words.split()) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1


def test_the_program_says_its_version_its_verbs_and_units(capsys):
    assert run(["--version"]) == 0
    assert capsys.readouterr().out.startswith("np-drake 0.")
    assert run([]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "train" in said
    for option in ("--seed", "--out DIR", "--json FILE", "--markdown FILE", "--solver"):
        assert option in said.split("Shared options")[1]
    assert run(["train", "-h"]) == 0
    assert "flight logs [s]" in " ".join(capsys.readouterr().out.split())


def test_every_number_has_bounds_or_is_checked_by_what_it_is_passed_to():
    checked = {"visible", "duration", "mass", "wheelbase", "propeller", "hover_throttle"}
    checked |= {"mass_uncertainty", "thrust_uncertainty", "seconds", "payload"}
    for name, command in commands().items():
        for option in command.params:
            kind = option.type_descriptor.annotation
            if option.name not in checked and {int, float} & {kind, *typing.get_args(kind)}:
                assert option.min is not None, (name, option.name)
                assert option.max is not None, (name, option.name)


@pytest.mark.parametrize(
    "words",
    [
        "--help",
        "vehicle list",
        "import missing.csv",
        "identify missing.csv --vehicle paper",
        "doctor missing.csv",
        "diagnose missing",
        "diagnose --train missing.csv --held-out missing.csv",
    ],
)
def test_help_and_refusals_wait_for_no_large_library(words):
    assert loaded(words) & {"torch", "pydrake", "matplotlib", "pandas", "scipy.signal"} == set()


@pytest.mark.parametrize(
    "words", ["train missing.csv --out a.safetensors", "evaluate missing.csv", "fly missing.yaml"]
)
def test_what_learns_loads_torch_when_its_flights_are_open(words):
    assert loaded(words) & {"torch", "matplotlib", "scipy.signal"} == set()


def loaded(words):
    """Names of the modules that are there when a command line ends."""
    code = f"import sys, diagrams.cli.main as m; m.run({words.split()}); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


def test_the_summary_of_a_verb_fits_on_its_line(capsys):
    assert run(["--help"]) == 0
    said = capsys.readouterr().out
    assert [
        name for name, (_, _, summary) in dut.VERBS.items() if f" {summary}\n" not in said
    ] == []


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
        (ValueError("mass must be\npositive"), 2, "mass must be positive\n"),
        (ValueError("verb: logs must differ."), 2, "logs must differ.\n"),
        (FileNotFoundError(2, "No such file", "a.csv"), 2, "a.csv: No such file.\n"),
        (OSError(28, "No space left"), 2, "writing: No space left. Free some room, or "),
        (FailedRun("the vehicle fell."), 1, "the vehicle fell.\n"),
        (KeyboardInterrupt(), 130, "interrupted.\n"),
        (MemoryError(), 70, "internal error: MemoryError: no message (test_app.py:"),
        (ZeroDivisionError("a\nb"), 70, "internal error: ZeroDivisionError: a b (test_app.py:"),
        (EOFError("cut off"), 70, "internal error: EOFError: cut off (test_app.py:"),
        (Panic("native"), 70, "internal error: Panic: native. Please report it"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else "",
)
def test_every_failure_is_one_line_and_an_exit_code(capsys, error, code, line):
    assert dut.run_app(failing(error), ["verb"]) == code
    said = capsys.readouterr().err.removeprefix("\n")  # typer begins a new line at an EOFError
    assert said.startswith(f"np-drake verb: {line}")
    assert said.count("\n") == 1


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


@pytest.mark.parametrize("option", ["--json", "--out"])
@pytest.mark.parametrize("link", ["itself", "symbolic", "hard"])
def test_an_output_is_no_input_by_any_name(logs, tmp_path, capsys, option, link):
    mine, other = tmp_path / "mine.csv", tmp_path / "other.csv"
    mine.write_bytes(logs[0].read_bytes())
    {"itself": lambda: None, "symbolic": lambda: other.symlink_to(mine)}.get(
        link, lambda: other.hardlink_to(mine)
    )()
    named = mine if link == "itself" else other
    words = ["identify", str(mine), "--vehicle", "paper", option, str(named)]
    assert run(words) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert mine.read_bytes() == logs[0].read_bytes()


def test_inputs_are_what_is_named_and_not_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a.csv", "b.json"):
        (tmp_path / name).touch()
    words = ["diagnose", ".", "--train=a.csv", "--json", "b.json", "--out=b.json", "none"]
    assert {str(path) for path in dut.inputs_of(words)} == {"a.csv"}


def test_a_reader_that_goes_away_ends_no_run(tmp_path):
    dut = shell(f"set -o pipefail; {NP_DRAKE} --help | head -1")
    assert (dut.returncode, dut.stderr) == (0, "")
    file = tmp_path / "m.json"
    words = f"export paper --format sdf --out {tmp_path}/x --json {file}"
    dut = shell(f"set -o pipefail; {NP_DRAKE} {words} | true")
    assert (dut.returncode, dut.stderr) == (0, "")
    assert json.loads(file.read_text())["schema"] == "np_drake.export/1"


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no such device")
def test_a_closed_stream_is_no_error_and_a_full_disk_is_one_line():
    assert shell(f"{NP_DRAKE} --version >&- 2>&-").returncode == 0
    dut = shell(f"{NP_DRAKE} --version > /dev/full")
    assert dut.returncode == 2
    assert "No space left on device" in dut.stderr
    assert dut.stderr.count("\n") == 1


def test_a_locale_without_utf8_writes_all_the_same(tmp_path):
    ascii_only = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    dut = shell(f"{NP_DRAKE} export paper --format sdf --out {tmp_path}/a.sdf", **ascii_only)
    assert (dut.returncode, dut.stderr) == (0, "")
    assert (tmp_path / "a.sdf").is_file()


SENDS = """
import os, signal, sys
class Sender:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.{name})
sys.meta_path.insert(0, Sender())
sys.argv[1:] = {words!r}
from diagrams.cli.main import main
main()
"""


@pytest.mark.parametrize(
    "name, module, words",
    [
        ("SIGTERM", "rich.progress", "vehicle list"),
        ("SIGINT", "pydrake", "vehicle show paper"),
        ("SIGINT", "torch", "train --envelope 1 --out never.safetensors"),
    ],
)
def test_a_signal_while_modules_are_imported_is_one_line(name, module, words):
    code, line = SIGNALS[name]
    program = SENDS.format(name=name, module=module, words=words.split())
    dut = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert dut.returncode == code
    assert dut.stderr.endswith(f": {line}\n")
    assert dut.stderr.count("\n") == 1


def test_a_signal_ends_a_run_and_leaves_no_half_file(tmp_path):
    words = f"fly hover --out {tmp_path}/out --json {tmp_path}/m.json"
    command = [sys.executable, "-m", "np_drake", *words.split()]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
    time.sleep(3.0)  # it flies by then, or imports, under the same law [s]
    process.send_signal(signal.SIGTERM)
    said = process.communicate(timeout=60)[1].decode()
    assert process.returncode == 143
    assert said in ("np-drake: ended by SIGTERM.\n", "np-drake fly: ended by SIGTERM.\n")
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]
