"""What is printed reaches any terminal, and no reader that goes away ends a run."""

import json
import os
import subprocess
import sys

import pytest

from diagrams.cli.streams import plain_characters

PROGRAM = [sys.executable, "-m", "np_drake"]


def shell(command, **variables):
    return subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, env={**os.environ, **variables}
    )


NP_DRAKE = f"{sys.executable} -m np_drake"


@pytest.mark.parametrize("verb", ["--help", "vehicle list", "vehicle show paper"])
def test_a_reader_that_goes_away_is_no_error(verb):
    dut = shell(f"set -o pipefail; {NP_DRAKE} {verb} | head -1")
    assert (dut.returncode, dut.stderr) == (0, "")
    assert dut.stdout.count("\n") == 1


def test_files_are_written_though_nobody_reads_the_lines(tmp_path):
    file = tmp_path / "m.json"
    dut = shell(
        f"set -o pipefail; {NP_DRAKE} export paper --format sdf --out {tmp_path}/x --json "
        f"{file} | true"
    )
    assert (dut.returncode, dut.stderr) == (0, "")
    assert json.loads(file.read_text())["schema"] == "np_drake.export/1"
    assert (tmp_path / "x").is_file()


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
def test_a_closed_stream_is_no_error(closed):
    assert shell(f"{NP_DRAKE} vehicle list {closed}").returncode == 0


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no such device")
def test_a_full_disk_behind_stdout_is_one_line():
    dut = shell(f"{NP_DRAKE} vehicle list > /dev/full")
    assert dut.returncode == 2
    assert (
        dut.stderr == "np-drake: standard output: No space left on device. Print somewhere else.\n"
    )


@pytest.mark.parametrize(
    "variables", [{"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C"}], ids=["ascii", "C"]
)
def test_a_terminal_of_ascii_is_printed_on(variables):
    for verb in ("vehicle list", "vehicle show paper", "train ä.csv --out m.safetensors"):
        dut = shell(f"{NP_DRAKE} {verb}", **variables)
        assert "Traceback" not in dut.stderr
        assert "internal" not in dut.stderr
        assert (
            dut.stdout + dut.stderr
        ).isascii() or "LC_ALL" in variables  # Python takes C for C.UTF-8
        assert dut.returncode == (2 if "train" in verb else 0)


def test_a_locale_without_utf8_flies_and_writes_all_the_same(tmp_path):
    ascii_only = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    dut = shell(f"{NP_DRAKE} export paper --format sdf --out {tmp_path}/a.sdf", **ascii_only)
    assert (dut.returncode, dut.stderr) == (0, "")
    assert (tmp_path / "a.sdf").is_file()


def test_characters_that_are_lacking_have_a_word_of_ascii():
    error = UnicodeEncodeError("ascii", "1 – 2 ± 3 m² é 漢", 0, 16, "")
    assert plain_characters(error) == ("1 - 2 +- 3 m2 e ?", 16)
