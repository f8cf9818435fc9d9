"""Laws of `python -m np_drake`."""

import subprocess
import sys
from importlib.metadata import version


def test_the_module_is_the_command_line():
    command = [sys.executable, "-m", "np_drake", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == f"np-drake {version('np_drake')}\n"
