"""Entry point `np-drake`: signals and streams first, then the verbs.

Exit code 0; 2 for bad input (one clear line on stderr, nothing half-written); 1 for a failed run;
70 for a fault of the program; 128 + number for a signal. `--debug` prints the traceback before the
line.
"""

import codecs
import locale
import os
import sys
from collections.abc import Sequence

from np_drake.files.interruption import end_at_once

# Before NumPy is loaded: its threads cost more than they bring on matrices of this size.
os.environ.setdefault("OMP_NUM_THREADS", "1")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code."""
    end_at_once()
    if arguments is None:
        _require_utf8()
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by the shell
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        getattr(sys, name).reconfigure(errors="replace")
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    import logging

    logging.basicConfig(level=logging.WARNING, format="%(levelname)s: %(message)s")
    logging.getLogger("drake").setLevel(logging.WARNING)
    waits = logging.getLogger("np_drake.compiled")  # says on stdout why the user waits
    waits.setLevel(logging.INFO)
    waits.propagate = False
    waits.addHandler(logging.StreamHandler(sys.stdout))
    code = run(arguments)
    end_at_once()
    sys.exit(code)


def _require_utf8() -> None:
    """Start again in Python's UTF-8 mode where the locale is none: Drake and the files of a run are
    read as text.
    """
    if not sys.flags.utf8_mode and codecs.lookup(locale.getencoding()).name != "utf-8":
        command = [sys.executable, "-X", "utf8", "-m", "np_drake", *sys.argv[1:]]
        os.execve(sys.executable, command, os.environ | {"PYTHONUTF8": "1"})


def run(arguments: list[str]) -> int:
    """Run the command line and return its exit code."""
    from diagrams.cli.app import app, run_app

    return run_app(app, arguments)
