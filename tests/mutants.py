"""Mutation testing of the science: one small change at a time, and whether a test notices it.

    python tests/mutants.py --count 50 --seed 0 [--only np_drake/effects]

A mutant changes one operator, comparison, constant or sign of `np_drake/` or `systems/` in a copy
of the repository. The test files of its module run there, then those that import it, until a test
fails. What none notices is printed: such a line lacks a law, or the change is equivalent. Exit code
1 below `--asked` killed.
"""

import argparse
import ast
import dataclasses as dc
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue

ROOT = Path(__file__).resolve().parent.parent
COPIED = ("np_drake", "systems", "diagrams", "tests", "docs")
COPIED += ("pyproject.toml", "README.md", "Makefile")
# Rooms without formulas: readers, texts and tables have tests of their own kind.
LEFT_OUT = ("np_drake/files", "np_drake/logs/formats", "np_drake/diagnosis/report")
LEFT_OUT += ("np_drake/__main__.py",)
SWAPS: dict[type, str] = {
    **{ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.Pow: "*"},
    **{ast.Lt: ">=", ast.LtE: ">", ast.Gt: "<=", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "=="},
    **{ast.And: "or", ast.Or: "and"},
}
TEXT: dict[type, str] = {
    **{ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"},
    **{ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="},
    **{ast.And: "and", ast.Or: "or"},
}
MOST = 20  # test files that run on a mutant
HANGS = 1800.0  # that they take at most: a mutant that hangs is noticed [s]


@dc.dataclass(frozen=True)
class Mutant:
    """A change of one file: `old` at (line, column), counted from 1 and 0, becomes `new`."""

    path: Path
    line: int
    column: int
    old: str
    new: str

    def __str__(self) -> str:
        """Return place, change and line."""
        text = (ROOT / self.path).read_text().splitlines()[self.line - 1].strip()
        return f"{self.path}:{self.line}:{self.column}  {self.old} -> {self.new}  |  {text}"

    def write(self, root: Path) -> None:
        """Write the changed file below `root`."""
        lines = (ROOT / self.path).read_text().splitlines(keepends=True)
        own = lines[self.line - 1]
        lines[self.line - 1] = own[: self.column] + self.new + own[self.column + len(self.old) :]
        (root / self.path).write_text("".join(lines))


def mutants_of(path: Path) -> Iterator[Mutant]:
    """Yield every mutant of a file outside messages, type annotations and docstrings."""
    text = (ROOT / path).read_text()
    lines = text.splitlines()
    tree = ast.parse(text)
    skipped = {
        id(n) for top in ast.walk(tree) for part in _without_effect(top) for n in ast.walk(part)
    }

    def between(a: ast.expr, b: ast.expr, operator: type) -> Iterator[Mutant]:
        old = TEXT[operator]
        if a.end_lineno == b.lineno and b.lineno is not None and a.end_col_offset is not None:
            at = lines[b.lineno - 1].find(old, a.end_col_offset, b.col_offset)
            if at >= 0 and lines[b.lineno - 1].isascii():
                yield Mutant(path, b.lineno, at, old, SWAPS[operator])

    for node in (n for n in ast.walk(tree) if id(n) not in skipped):
        if isinstance(node, ast.BinOp) and type(node.op) in SWAPS:
            yield from between(node.left, node.right, type(node.op))
        elif isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPS:
            yield from between(node.left, node.comparators[0], type(node.ops[0]))
        elif isinstance(node, ast.BoolOp):
            yield from between(node.values[0], node.values[1], type(node.op))
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            yield Mutant(path, node.lineno, node.col_offset, "-", "+")
        elif (
            isinstance(node, ast.Constant)
            and type(node.value) in (int, float)
            and lines[node.lineno - 1].isascii()
        ):
            old = lines[node.lineno - 1][node.col_offset : node.end_col_offset]
            new = (
                str(node.value + 1) if isinstance(node.value, int) else repr(2 * node.value + 1e-3)
            )
            yield Mutant(path, node.lineno, node.col_offset, old, new)


def _without_effect(node: ast.AST) -> list[ast.AST]:
    """Return the parts of a node in which no mutant is made."""
    if isinstance(node, ast.Raise | ast.JoinedStr):
        return [node]
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        arguments = [*node.args.args, *node.args.kwonlyargs]
        found = [node.returns, *(a.annotation for a in arguments)]
        return [f for f in found if f is not None]
    return [node.annotation] if isinstance(node, ast.AnnAssign) else []


def files_reaching(path: Path) -> list[str]:
    """Return the test files of a module's name, those that import it, and of these at most `MOST`,
    the nearest first.
    """
    module = ".".join(path.with_suffix("").parts)
    names, room = (f"test_{path.name}", f"test_{path.parent.name}.py"), Path("tests") / path.parent
    every = [p.relative_to(ROOT) for p in sorted((ROOT / "tests").rglob("test_*.py"))]
    found = [p for p in every if p.name in names or module in (ROOT / p).read_text()]
    found.sort(key=lambda p: (p.name != names[0], p.name != names[1] and p.parent != room))
    return [str(p) for p in found[:MOST]]


def killer_of(mutant: Mutant, root: Path) -> str:
    """Return the test that notices a mutant in the copy at `root`; "" where none does."""
    tests = files_reaching(mutant.path)
    if not tests:
        return ""
    mutant.write(root)
    # With a cache by file, a caller in another file keeps the function with which it was compiled.
    compiled = "@compiled" in (ROOT / mutant.path).read_text()
    fresh = {"NUMBA_CACHE_DIR": str(root / "cache")} if compiled else {}
    shutil.rmtree(root / "cache", ignore_errors=True)
    environment = os.environ | {"PYTHONPATH": str(root), "MPLBACKEND": "Agg"} | fresh
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    try:
        how = {"env": environment, "capture_output": True, "text": True}
        done = subprocess.run(command, cwd=root, timeout=HANGS, **how)
    except subprocess.TimeoutExpired:
        return "time"
    finally:
        shutil.copyfile(ROOT / mutant.path, root / mutant.path)
    lines = done.stdout.splitlines()
    failed = [line.split()[1] for line in lines if line.startswith(("FAILED ", "ERROR "))]
    return (failed or [f"code {done.returncode}"])[0] if done.returncode else ""


def copied(root: Path) -> Path:
    """Return a new copy of the repository, in which mutants are written."""
    for name in (n for n in COPIED if (ROOT / n).exists()):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copyfile
        copy(ROOT / name, root / name)
    return root


def main() -> int:
    """Draw mutants, try them, and print what is left."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=50, help="mutants drawn")
    parser.add_argument("--seed", type=int, default=0, help="of the draw")
    parser.add_argument("--only", action="append", default=[], help="files or folders to draw from")
    parser.add_argument("--line", help="only mutants of this line: PATH:LINE")
    parser.add_argument("--jobs", type=int, default=1, help="mutants at once")
    parser.add_argument("--asked", type=float, default=0.9, help="least share killed")
    options = parser.parse_args()
    tops = (ROOT / "np_drake", ROOT / "systems")
    paths = [p.relative_to(ROOT) for top in tops for p in sorted(top.rglob("*.py"))]
    paths = [p for p in paths if not str(p).startswith(LEFT_OUT) and p.name != "__init__.py"]
    only = [options.line.rpartition(":")[0]] if options.line else options.only
    paths = [p for p in paths if not only or str(p).startswith(tuple(only))]
    every = [m for p in paths for m in mutants_of(p)]
    if options.line:
        every = [m for m in every if m.line == int(options.line.rpartition(":")[2])]
    drawn = random.Random(options.seed).sample(every, min(options.count, len(every)))
    of = f"{len(drawn)} of {len(every)} mutants in {len(paths)} files"
    print(f"seed {options.seed}: {of}.", flush=True)
    alive = []
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(options.jobs) as pool:
        roots: Queue[Path] = Queue()
        for k in range(options.jobs):
            roots.put(copied(Path(folder) / str(k)))

        def tried(mutant: Mutant) -> tuple[str, float]:
            start, root = time.monotonic(), roots.get()
            try:
                return killer_of(mutant, root), time.monotonic() - start
            finally:
                roots.put(root)

        for i, (killer, spent) in enumerate(pool.map(tried, drawn), 1):
            mutant = drawn[i - 1]
            alive += [] if killer else [mutant]
            said = f"killed by {killer}" if killer else "SURVIVES"
            print(f"{i:3d}/{len(drawn)}  {spent:4.0f} s  {said}  {mutant}", flush=True)
    killed = 1 - len(alive) / max(1, len(drawn))
    head = f"{len(drawn) - len(alive)} of {len(drawn)} killed; survivors:"
    print(head, *(alive or ["none"]), sep="\n  ")
    return int(killed < options.asked)


if __name__ == "__main__":
    sys.exit(main())
