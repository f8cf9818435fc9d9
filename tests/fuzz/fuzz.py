"""Fuzz the parsers: python tests/fuzz/fuzz.py [--seconds S] [--out DIR] [--seed N] [TARGET …].

With Atheris (extra `fuzz`) guided by coverage, one process a target; without it by random changes.
Inputs that break a reader are written to --out. Exit code 1 where there are any.
"""

import argparse
import hashlib
import random
import resource
import subprocess
import sys
import tempfile
import time
import traceback
from pathlib import Path

MOST = 1 << 30  # memory that a reader may take for a file of at most 10 MB [bytes]


def main() -> int:
    """Fuzz every chosen target and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help="default: all")
    parser.add_argument("--seconds", type=float, default=60.0, help="of every target")
    parser.add_argument(
        "--out", type=Path, default=Path("out/fuzz"), help="folder of inputs that break a reader"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--guided", action="store_true", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.guided:
        _guided(chosen.targets[0], chosen.seconds, chosen.out, chosen.seed)
    from targets import TARGETS

    unknown = sorted(set(chosen.targets) - set(TARGETS))
    if unknown:
        parser.error(f"target must be one of {', '.join(TARGETS)}; got {', '.join(unknown)}")
    guided, broken = importable("atheris"), 0
    chosen.out.mkdir(parents=True, exist_ok=True)
    for name in chosen.targets or TARGETS:
        before = set(chosen.out.iterdir())
        if guided:
            again = [sys.executable, __file__, name, "--guided", "--seconds", str(chosen.seconds)]
            subprocess.run(
                [*again, "--out", str(chosen.out), "--seed", str(chosen.seed)], check=False
            )
        else:
            count = random_search(TARGETS[name], chosen.seconds, chosen.out, chosen.seed)
            print(f"{name}: {count} inputs", flush=True)
        found = set(chosen.out.iterdir()) - before
        broken += len(found)
        print(f"{name}: {len(found)} broke the reader" if found else f"{name}: sound", flush=True)
    return 1 if broken else 0


def importable(name: str) -> bool:
    """Return whether a module can be imported."""
    import importlib.util

    return importlib.util.find_spec(name) is not None


def random_search(target, seconds: float, out: Path, seed: int) -> int:
    """Feed random changes of the seeds to a target until the time is up; return the number of
    inputs.
    """
    from mutation import mutate

    rng, count, end = random.Random(f"{target.name} {seed}"), 0, time.monotonic() + seconds
    with tempfile.TemporaryDirectory() as folder:
        seeds = target.seeds(Path(folder))
        while time.monotonic() < end:
            data = mutate(rng.choice(seeds), rng)
            count += 1
            if _breaks(target, data, Path(folder)):
                _keep(target.name, data, out)
    return count


def _breaks(target, data: bytes, folder: Path) -> bool:
    """Return whether an input breaks a reader, and print how."""
    from targets import check

    path = folder / f"input{target.suffix}"
    path.write_bytes(data)
    before = _peak()
    try:
        check(target, path)
    except Exception:
        traceback.print_exc(limit=-4)
        return True
    used = _peak() - before
    if used > MOST:
        print(f"{target.name}: {used >> 20} MiB of memory")
    return used > MOST


def _peak() -> int:
    """Return the largest memory that this process ever took [bytes]."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _keep(name: str, data: bytes, out: Path) -> None:
    (out / f"{name}-{hashlib.sha256(data).hexdigest()[:12]}").write_bytes(data)


def _guided(name: str, seconds: float, out: Path, seed: int) -> None:
    """Fuzz one target with Atheris; ends the process."""
    import atheris

    with atheris.instrument_imports(include=["np_drake", "diagrams"]):
        from targets import TARGETS
    target = TARGETS[name]
    work = Path(tempfile.mkdtemp())
    corpus = work / "corpus"
    corpus.mkdir()
    for number, data in enumerate(target.seeds(work)):
        (corpus / f"seed{number}").write_bytes(data)

    def one_input(data: bytes) -> None:
        if _breaks(target, data, work):
            _keep(name, data, out)

    options = [
        f"-max_total_time={max(round(seconds), 1)}",
        f"-seed={seed + 1}",
        "-print_final_stats=1",
    ]
    limits = [
        "-max_len=65536",
        "-timeout=60",
        "-rss_limit_mb=4096",
        f"-artifact_prefix={out}/{name}-",
    ]
    atheris.Setup([sys.argv[0], str(corpus), *options, *limits], one_input)
    atheris.Fuzz()


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[2]))
    sys.exit(main())
