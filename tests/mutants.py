"""Mutation testing of the science: one small change at a time, and whether a test notices it.

    python tests/mutants.py --count 50 --seed 0 [--only np_drake/effects]

A mutant changes one operator, comparison, constant or sign of `np_drake/` or `systems/`. The suite
runs once on a copy of the repository, to see which tests reach which mutant. Those run on each
mutant, nearest first, until one fails. What none notices is printed: such a line lacks a law, or
the change is equivalent. Exit code 1 below `--asked` killed.
"""

import argparse
import ast
import dataclasses as dc
import itertools
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

from mutant_probe import FOLDER, reached

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
MOST_SECONDS = 100.0  # of the tests that run on a mutant, as the suite took them
MOST_TESTS = 200
UNKNOWN = 10.0  # of a file whose time no run has told [s]
HANGS = 10.0  # times as long, and a minute to begin: a mutant that hangs is noticed


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


def probes_of(path: Path, mutants: dict[int, Mutant]) -> str:
    """Return the text of a file with a probe before the statement of each mutant.

    A statement outside functions, or in a compiled function, is reached by whatever runs a plain
    function of its file.
    """
    text = (ROOT / path).read_text()
    lines, tree = text.splitlines(keepends=True), ast.parse(text)
    compiled = {
        id(n)
        for f in ast.walk(tree)
        if isinstance(f, ast.FunctionDef)
        and any("compiled" in ast.unparse(d) for d in f.decorator_list)
        for n in ast.walk(f)
    }
    functions = [
        n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef) and id(n) not in compiled
    ]
    within = [
        n
        for f in functions
        for s in f.body
        for n in ast.walk(s)
        if isinstance(n, ast.stmt) and not _is_text(n, s, f)
    ]
    first = [next((s for s in f.body if not _is_text(s, s, f)), None) for f in functions]
    at: dict[tuple[int, int], list[int]] = {}
    for number, mutant in mutants.items():
        around = [
            n
            for n in within
            if n.lineno <= mutant.line <= (n.end_lineno or 0)
            and not lines[n.lineno - 1].lstrip().startswith("elif")
            and (n.lineno, n.col_offset) <= (mutant.line, mutant.column)
        ]
        places = (
            [max(around, key=lambda n: (n.lineno, n.col_offset))]
            if around
            else [n for n in first if n]
        )
        for place in places:
            above = min([place.lineno, *(d.lineno for d in getattr(place, "decorator_list", ()))])
            at.setdefault((above, place.col_offset), []).append(number)
    for (line, column), numbers in sorted(at.items(), reverse=True):
        probe = f"__import__('mutant_probe').hit({', '.join(map(str, dict.fromkeys(numbers)))})"
        lines.insert(line - 1, " " * column + probe + "\n")
    return "".join(lines)


def _is_text(node: ast.AST, statement: ast.stmt, function: ast.FunctionDef) -> bool:
    """Return whether a node is the docstring of a function."""
    return (
        node is statement is function.body[0]
        and isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
    )


def run_probed(drawn: list[Mutant], root: Path, workers: int, notes: Path) -> None:
    """Run the suite once with probes in the copy at `root`, left as it was, and fill `notes`."""
    by_file: dict[Path, dict[int, Mutant]] = {}
    for number, mutant in enumerate(drawn):
        by_file.setdefault(mutant.path, {})[number] = mutant
    for path, mutants in by_file.items():
        text = probes_of(path, mutants)
        compile(text, str(path), "exec")
        (root / path).write_text(text)
    notes.mkdir(parents=True)
    environment = _environment(root) | {FOLDER: str(notes)}
    how = f"-m pytest -q -p mutant_probe -n {workers} --dist worksteal tests".split()
    command = [sys.executable, *how]
    subprocess.run(command, cwd=root, env=environment, capture_output=True, check=False)
    for path in by_file:
        shutil.copyfile(ROOT / path, root / path)


def _environment(root: Path) -> dict[str, str]:
    return os.environ | {"PYTHONPATH": f"{root}{os.pathsep}{root / 'tests'}", "MPLBACKEND": "Agg"}


def files_naming(path: Path, *, importing: bool) -> dict[str, float]:
    """Return the test files of a module's name, with `importing` those too that import it.

    A probe does not see calls of compiled functions, and those that a cache answers.
    """
    module = ".".join(path.with_suffix("").parts)
    every = sorted((ROOT / "tests").rglob("test_*.py"))
    named = [p for p in every if p.name in (f"test_{path.name}", f"test_{path.parent.name}.py")]
    found = [*named, *(p for p in every if importing and module in p.read_text())]
    return {str(p.relative_to(ROOT)): UNKNOWN for p in dict.fromkeys(found)}


def _distance(path: Path, test: str) -> int:
    """Return how near a test lies to a source file: 0 its own, 1 in its room, 2 elsewhere."""
    file = Path(test.partition("::")[0])
    room = file.parent == Path("tests") / path.parent or file.name == f"test_{path.parent.name}.py"
    return 0 if file.name == f"test_{path.name}" else 1 if room else 2


def killer_of(mutant: Mutant, tests: dict[str, float], root: Path) -> str:
    """Return the test that notices a mutant in the copy at `root`; "" where none does."""
    if not tests:
        return ""
    nearest = sorted(tests, key=lambda name: (_distance(mutant.path, name), tests[name]))
    until = itertools.accumulate(tests[name] for name in nearest)
    chosen = [n for n, spent in zip(nearest, until, strict=True) if spent <= MOST_SECONDS][
        :MOST_TESTS
    ] or nearest[:1]
    limit = 60 + HANGS * sum(tests[name] for name in chosen)
    mutant.write(root)
    # With a cache by file, a caller in another file keeps the function with which it was compiled.
    compiled = "@compiled" in (ROOT / mutant.path).read_text()
    fresh = {"NUMBA_CACHE_DIR": str(root / "cache")} if compiled else {}
    shutil.rmtree(root / "cache", ignore_errors=True)
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *chosen]
    try:
        how = {"env": _environment(root) | fresh, "capture_output": True, "text": True}
        done = subprocess.run(command, cwd=root, timeout=limit, **how)
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
    parser.add_argument("--numbers", help="of the draw, from 1 on, with commas: only these")
    parser.add_argument("--notes", type=Path, help="folder of the suite's run, kept for another")
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
        notes = (options.notes or Path(folder) / "notes").resolve()
        if not notes.exists():
            run_probed(drawn, copied(Path(folder) / "probed"), options.jobs, notes)
        tests = reached(notes)
        print(f"The suite reaches {len(tests)} of them.", flush=True)

        def tried(number: int) -> tuple[str, float]:
            start, root = time.monotonic(), roots.get()
            try:
                reaching = tests.get(number, {})
                whole = files_naming(drawn[number].path, importing=not reaching)
                apart = {n: t for n, t in reaching.items() if n.partition("::")[0] not in whole}
                return killer_of(drawn[number], whole | apart, root), time.monotonic() - start
            finally:
                roots.put(root)

        asked = options.numbers.split(",") if options.numbers else range(1, len(drawn) + 1)
        some = [int(k) - 1 for k in asked]
        for i, (killer, spent) in zip(some, pool.map(tried, some), strict=True):
            mutant = drawn[i]
            alive += [] if killer else [mutant]
            said = f"killed by {killer}" if killer else "SURVIVES"
            print(f"{i + 1:3d}/{len(drawn)}  {spent:4.0f} s  {said}  {mutant}", flush=True)
    killed = 1 - len(alive) / max(1, len(some))
    head = f"{len(some) - len(alive)} of {len(some)} killed; survivors:"
    print(head, *(alive or ["none"]), sep="\n  ")
    return int(killed < options.asked)


if __name__ == "__main__":
    sys.exit(main())
