"""Compare every verb of many cases with itself: python tests/campaigns/verbs_alike.py [--out DIR]
[VERB …].

Each runs on one local process, on two, on a Dask cluster of two worker processes, and on two again
after a kill of all its processes when half of its cases are finished. All that it writes must be
the same, but for times: files byte for byte, JSON value for value, Markdown cell for cell. Verbs of
real flights need their folders: NP_DRAKE_NEUROBEM and NP_DRAKE_REAL. Exit code 1 where anything
differs.
"""

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from verbs import SECONDS, VERBS, Verb

from diagrams.batch.campaign import unpacked

SERIAL, PAIR, CLUSTER, KILLED = "jobs 1", "jobs 2", "cluster", "killed"
FOLDERS = {
    "neurobem": "NP_DRAKE_NEUROBEM",
    "real": "NP_DRAKE_REAL",
}  # and what names them in the environment
PATIENCE = 900.0  # until half of the cases must be finished [s]
TIME = "(time)"  # stands in the place of one
ARRAYS, CLOCKED = (
    ("signals",),
    "solve_time",
)  # names of packed arrays, and of those in them that are times


class Alike:
    """Runs of one verb, each in a folder of its own, compared with the serial one."""

    def __init__(self, name: str, verb: Verb, folder: Path, given: dict[str, str], scheduler: str):
        self.name, self.verb, self.folder, self.given = name, verb, folder, given
        self.scheduler = scheduler
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)

    def compare(self) -> Iterator[tuple[str, list[str]]]:
        """Yield (way, what differs from the serial run) for every other way."""
        self._run(SERIAL, "--jobs 1")
        alone = self._content(SERIAL)
        self._run(PAIR, "--jobs 2")
        yield PAIR, differences(alone, self._content(PAIR))
        self._run(CLUSTER, f"--scheduler {self.scheduler}")
        yield CLUSTER, differences(alone, self._content(CLUSTER))
        kept = self._kill()
        self._run(KILLED, "--jobs 2")
        again = [str(path) for path, written in kept.items() if path.stat().st_mtime_ns != written]
        yield (
            KILLED,
            differences(alone, self._content(KILLED))
            + [f"{path}: worked on twice" for path in again],
        )

    def _command(self, way: str, where: str) -> list[str]:
        places = {**self.given, "out": str(self._out(way))}
        words = f"{self.name} {self.verb.arguments} {self.verb.places} {where}".split()
        return [sys.executable, "-m", "np_drake", *(word.format(**places) for word in words)]

    def _out(self, way: str) -> Path:
        return self.folder / way.replace(" ", "_")

    def _finished(self, way: str) -> list[Path]:
        return [path for path in self._out(way).glob(self.verb.finished) if path.is_file()]

    def _run(self, way: str, where: str) -> None:
        """Run the verb to its end.

        Raises: RuntimeError: where it fails.
        """
        done = subprocess.run(self._command(way, where), capture_output=True, text=True)
        if done.returncode != 0:
            raise RuntimeError(
                f"{self.name}, {way}: exit code {done.returncode}: {done.stderr[-800:]}"
            )

    def _kill(self) -> dict[Path, int]:
        """Kill a run of two processes, with all of them, when half of its cases are finished.

        Returns: the files of those cases and when they were written [ns].
        Raises: RuntimeError: where it was over before, or nothing was finished.
        """
        every = len(self._finished(SERIAL))
        with subprocess.Popen(
            self._command(KILLED, "--jobs 2"),
            start_new_session=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        ) as running:
            until = time.monotonic() + PATIENCE
            while len(self._finished(KILLED)) < every / 2 and running.poll() is None:
                if time.monotonic() > until:
                    break
                time.sleep(0.005)
            os.killpg(running.pid, signal.SIGKILL)
        kept = {
            path: path.stat().st_mtime_ns for path in self._finished(KILLED) if has_result(path)
        }
        if running.returncode != -signal.SIGKILL or not 0 < len(kept) < every:
            raise RuntimeError(f"{self.name}: killed with {len(kept)} of {every} cases finished.")
        return kept

    def _content(self, way: str) -> dict[str, Any]:
        """Return what a run wrote, by place: without times, and with its own folder's name taken
        out.
        """
        out = self._out(way)
        beside = [out.with_name(f"{out.name}.{kind}") for kind in ("json", "md")]
        return {
            str(path.relative_to(out.parent)).removeprefix(out.name): read(
                path, self.verb, str(out)
            )
            for path in [*beside, *sorted(out.rglob("*"))]
            if path.is_file()
            and not path.name.startswith(".")  # a killed writer's temporary file, never read
        }


def has_result(path: Path) -> bool:
    """Return whether a case is done; one whose worker the kill reached first has an error, and is
    worked on again.
    """
    return path.suffix != ".json" or "error" not in json.loads(path.read_text())


def read(path: Path, verb: Verb, out: str) -> Any:
    """Return the content of a file without times: JSON and Markdown parsed, others as bytes."""
    if path.suffix == ".json":
        return timeless(json.loads(path.read_text().replace(out, "OUT")), verb.times | SECONDS)
    if path.suffix == ".md":
        return cells(path.read_text(), verb.columns, verb.rows)
    return path.read_bytes()


def timeless(value: Any, times: frozenset[str]) -> Any:
    """Return a value of JSON with the times in it replaced by a word."""
    if isinstance(value, dict):
        value = {
            k: unpacked(v) if k in ARRAYS and isinstance(v, str) else v for k, v in value.items()
        }
        left_out = {k for k in value if k in times or k.startswith(CLOCKED)}
        return {k: TIME if k in left_out else timeless(v, times) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return value.tobytes()
    return [timeless(item, times) for item in value] if isinstance(value, list) else value


def cells(text: str, columns: tuple[str, ...], rows: tuple[str, ...] = ()) -> list[list[str]]:
    """Return the lines of Markdown as cells, without those in columns and rows of times."""
    lines, left_out = [], set()
    for line in text.splitlines():
        row = [cell.strip() for cell in line.split("|")]
        found = {number for number, cell in enumerate(row) if cell in columns}
        left_out = found or (left_out if line.startswith("|") else set())
        of_times = range(2, len(row)) if len(row) > 1 and row[1] in rows else left_out
        lines.append([TIME if number in of_times else cell for number, cell in enumerate(row)])
    return lines


def differences(one: Any, other: Any, at: str = "") -> list[str]:
    """Return a line for every place at which two contents differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        keys = [*one, *(key for key in other if key not in one)]
        return [
            line
            for k in keys
            for line in differences(one.get(k, "-"), other.get(k, "-"), f"{at}/{k}")
        ]
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        pairs = enumerate(zip(one, other, strict=True))
        return [line for k, (a, b) in pairs for line in differences(a, b, f"{at}[{k}]")]
    if one == other or (one != one and other != other):  # NaN is as NaN
        return []
    return [f"{at}: {str(one)[:80]!s} and {str(other)[:80]!s}"]


def main() -> int:
    """Compare the chosen verbs and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "verbs", nargs="*", metavar="VERB", help="as 'challenge make'; default: all"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out/campaigns"), help="folder of all runs"
    )
    chosen = parser.parse_args()
    if unknown := sorted(set(chosen.verbs) - set(VERBS)):
        parser.error(f"VERB must be one of {', '.join(VERBS)}; got {', '.join(unknown)}")
    given = {folder: os.environ[name] for folder, name in FOLDERS.items() if os.environ.get(name)}
    given["set"], given["arrays"] = (
        str(flown_set(chosen.out / "set")),
        str(made_arrays(chosen.out / "arrays")),
    )
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as local:
        alike = [
            compared(name, chosen.out, given, local.scheduler_address)
            for name in chosen.verbs or VERBS
        ]
    return 0 if all(alike) else 1


def made_arrays(folder: Path) -> Path:
    """Write made flights in the form of the real ones; the first is as long as `sample-efficiency`
    asks for.
    """
    from np_drake.logs.formats.neurobem_wrenches import TESTS, TRAINING

    (folder / "npy").mkdir(parents=True, exist_ok=True)
    for seed, stem in enumerate([TRAINING, *TESTS]):
        draw, t = np.random.default_rng(seed), 0.0025 * np.arange(700 if seed else 4000)
        rate, phase = draw.uniform(2.0, 25.0, (12, 8)), draw.uniform(0, 2 * np.pi, (12, 8))
        waves = np.sin(rate * t[:, None, None] + phase).sum(axis=2)
        np.save(folder / "npy" / f"{stem}.npy", waves * np.repeat([1.0, 1.0, 1.0, 0.05], 3))
    return folder


def flown_set(folder: Path) -> Path:
    """Fly the challenge set that `challenge solve` answers; what is there already stays."""
    arguments = ["--cases", "3", "--clean", "1", "--seconds", "5", "--seed", "11"]
    places = ["--out", str(folder / "cases"), "--truth", str(folder / "truth")]
    program = [sys.executable, "-m", "np_drake", "challenge", "make", *places, *arguments]
    subprocess.run(program, check=True, capture_output=True)
    return folder


def compared(name: str, out: Path, given: dict[str, str], scheduler: str) -> bool:
    """Compare one verb, print what came of it and return whether all ways are alike."""
    verb, start = VERBS[name], time.monotonic()
    if lacking := [FOLDERS[f] for f in FOLDERS if verb.needs(f) and f not in given]:
        print(f"{name}: not run, {' and '.join(lacking)} must name the real flights", flush=True)
        return True
    found, same = [], []
    try:
        for way, lines in Alike(
            name, verb, out / name.replace(" ", "_"), given, scheduler
        ).compare():
            found += [f"{name}, {way}: {line}" for line in lines]
            same += [] if lines else [way]
    except RuntimeError as error:
        found.append(str(error))
    print(
        f"{name}: as {SERIAL}: {', '.join(same) or 'nothing'}; {time.monotonic() - start:.0f} s",
        flush=True,
    )
    print(*(f"  {line}\n" for line in found[:20]), sep="", end="", flush=True)
    return not found


if __name__ == "__main__":
    sys.exit(main())
