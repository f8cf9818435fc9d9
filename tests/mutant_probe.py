"""Which tests reach a place in the source: calls of `hit` are written into a copy, and the suite
runs there once.

Loaded as a pytest plugin it notes the outcome and duration of every test beside the hits. The
environment names the folder: MUTANT_PROBE.
"""

import json
import os
from collections import defaultdict
from pathlib import Path
from typing import Any

FOLDER = "MUTANT_PROBE"
_seen: set[tuple[int, str]] = set()


def hit(*places: int) -> None:
    """Note that the running test reached these places; in its own processes too."""
    running = os.environ.get("PYTEST_CURRENT_TEST", "")
    for place in places:
        if (place, running) not in _seen:
            _seen.add((place, running))
            with open(
                Path(os.environ[FOLDER]) / f"{os.getpid()}.hits", "a", encoding="utf-8"
            ) as stream:
                stream.write(json.dumps([place, running]) + "\n")


def pytest_runtest_logreport(report: Any) -> None:
    """Note how a test ended and how long it took."""
    if "PYTEST_XDIST_WORKER" not in os.environ:
        with open(Path(os.environ[FOLDER]) / "tests.reports", "a", encoding="utf-8") as stream:
            stream.write(
                json.dumps([report.nodeid, report.when, report.outcome, report.duration]) + "\n"
            )


def reached(folder: Path) -> dict[int, dict[str, float]]:
    """Return for each place the tests that passed and reached it with their durations [s].

    What a fixture reaches is reached by every test of its file, and its time counts for each.
    """
    reports = [json.loads(line) for line in (folder / "tests.reports").read_text().splitlines()]
    seconds: dict[str, float] = {}
    shared: dict[str, float] = defaultdict(float)
    of_file: dict[str, set[str]] = defaultdict(set)
    for name, when, _, spent in reports:
        file = name.partition("::")[0]
        shared[file] = max(shared[file], spent if when == "setup" else 0.0)
        if when == "call":
            seconds[name] = spent
            of_file[file].add(name)
    seconds = {name: spent + shared[name.partition("::")[0]] for name, spent in seconds.items()}
    for name in (name for name, _, outcome, _ in reports if outcome != "passed"):
        seconds.pop(name, None)
    found: dict[int, set[str]] = defaultdict(set)
    for notes in folder.glob("*.hits"):
        for place, running in map(json.loads, notes.read_text().splitlines()):
            name, _, phase = running.rpartition(" ")
            found[place] |= {name} if phase == "(call)" else of_file[name.partition("::")[0]]
    fastest = sorted(seconds, key=lambda n: seconds[n])
    return {place: {n: seconds[n] for n in fastest if n in names} for place, names in found.items()}
