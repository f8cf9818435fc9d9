"""Keeps Drake's log for what is news: an iteration cap that the caller handles is an answer, not a warning."""

import contextlib
import logging
from collections.abc import Iterator


@contextlib.contextmanager
def expected_early_ends() -> Iterator[None]:
    """Mutes the logger `drake` below ERROR inside the block."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)
