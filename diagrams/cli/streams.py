"""Standard streams that outlive their reader and print on any terminal."""

import codecs
import errno
import io
import logging
import os
import sys
import unicodedata
from typing import TextIO

PLAIN = "np_drake.plain"  # name of the error handler
WORDS = {
    "–": "-",
    "…": "...",
    "·": ".",
    "±": "+-",
    "−": "-",
    "×": "x",
    "│": "|",
    "━": "-",
    "τ": "tau",
}


class Outlet(io.FileIO):
    """File descriptor whose failure to write ends no run; `failure` is the first one.

    Whoever closes a pipe, as `head` does, wants no more lines; the files of the run are still
    wanted.
    """

    failure: OSError | None = None

    def write(self, content) -> int:  # type: ignore[override]
        """Write, or discard once writing has failed."""
        if self.failure is None:
            try:
                return super().write(content) or 0
            except OSError as error:
                self.failure = error
        return len(content)


class Waits(logging.Handler):
    """Says on stdout why the user waits, so that stderr stays for errors."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print the line at once."""
        print(record.getMessage(), flush=True)

    @classmethod
    def explain(cls) -> None:
        """Print what the compiler of inner loops tells."""
        logger = logging.getLogger("np_drake.compiled")
        logger.setLevel(logging.INFO)
        logger.propagate = False
        logger.addHandler(cls())


def open_streams() -> list[Outlet]:
    """Put tolerant streams in the place of stdout and stderr, and return their outlets."""
    codecs.register_error(PLAIN, plain_characters)
    outlets = []
    for number, name in ((1, "stdout"), (2, "stderr")):
        before: TextIO | None = getattr(sys, name)
        if before is None:  # closed by the shell
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
            continue
        before.flush()
        outlet = Outlet(number, "w", closefd=False)
        buffered = before.isatty() or number == 2
        text = io.TextIOWrapper(
            io.BufferedWriter(outlet), before.encoding, errors=PLAIN, line_buffering=buffered
        )
        setattr(sys, name, text)
        outlets.append(outlet)
    return outlets


def failure_of(outlets: list[Outlet]) -> OSError | None:
    """Return why an outlet could not be written, after flushing; None where its reader only went
    away.
    """
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    failures = [outlet.failure for outlet in outlets if outlet.failure is not None]
    return next((error for error in failures if error.errno != errno.EPIPE), None)


def plain_characters(error: UnicodeError) -> tuple[str, int]:
    """Return ASCII for the characters that an encoding lacks, and where encoding goes on: an error
    handler.

    Raises: UnicodeError: if the error is not one of encoding.
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return "".join(WORDS.get(letter) or _plain(letter) for letter in lacking), error.end


def _plain(letter: str) -> str:
    return unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode() or "?"
