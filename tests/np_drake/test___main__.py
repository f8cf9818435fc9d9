"""Laws of `python -m np_drake`."""

import subprocess
import sys
from importlib.metadata import version


def test_the_module_is_the_command_line():
    command = [sys.executable, "-m", "np_drake", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == f"np-drake {version('np_drake')}\n"


def test_a_wrong_verb_is_one_line_and_exit_code_2():
    done = subprocess.run([sys.executable, "-m", "np_drake", "fry"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("np-drake fry: No such command 'fry'.")
    assert done.stderr.count("\n") == 1
