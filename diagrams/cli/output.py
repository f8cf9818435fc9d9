"""What every verb prints and writes: console, progress, tables, `--json` files, figures, folders.

Only the command line prints. Files appear whole or not at all (`np_drake.atomic_file`).
"""

import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table as Grid

from np_drake.atomic_file import require_writable, write_json, write_text

WIDTH = 100  # columns a table may take
Advance = Callable[..., None]  # (done, text="")
Table = tuple[str, list[str], list[tuple]]  # title, header, rows


def console(*, stderr: bool = False) -> Console:
    """A console at most `WIDTH` columns wide, and that wide where the output is no terminal."""
    stream = sys.stderr if stderr else sys.stdout
    width = min(WIDTH, Console(file=stream).width) if stream.isatty() else WIDTH
    return Console(file=stream, width=width, highlight=False)


def say(*lines: str) -> None:
    """Plain lines on stdout."""
    for line in lines:
        console().print(line, markup=False, soft_wrap=True)


@contextmanager
def progress(description: str, total: float) -> Iterator[Advance]:
    """A progress bar on stderr for anything over two seconds; yields `advance(done, text)`.

    `done` counts up to `total`; `text` stands behind the bar. Where stderr is no terminal nothing moves: the
    bar is printed once, at its end.
    """
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[text]}"),
    )
    with Progress(*columns, console=console(stderr=True)) as bar:
        task = bar.add_task(description, total=total, text="")

        def advance(done: float, text: str = "") -> None:
            bar.update(task, completed=done, text=text)

        yield advance


def counted(advance: Advance, what: str = "") -> Callable[[int, int], None]:
    """An `on_progress(done, total)` that moves a bar of total 1."""
    return lambda done, total: advance(done / total, f"{done} of {total} {what}".rstrip())


@contextmanager
def flying(description: str, out: Path | None) -> Iterator[tuple[Path, Callable[[int, int], None]]]:
    """What flights over several seeds need: a folder for models (one that goes, without `out`), and `on_progress`."""
    with tempfile.TemporaryDirectory() as scratch, progress(description, 1.0) as advance:
        yield make_folder(out) if out else Path(scratch), counted(advance, "flights")


def print_table(title: str, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """A table in `WIDTH` columns: text to the left, numbers to the right with three digits."""
    table = Grid(title=escape(title), title_justify="left", pad_edge=False)
    for column, name in enumerate(header):
        numeric = all(isinstance(row[column], float | int | None) for row in rows)
        table.add_column(escape(name), justify="right" if numeric else "left", overflow="fold")
    for row in rows:
        table.add_row(*(escape(_cell(value)) for value in row))
    console().print(table)


def write_markdown(path: Path | None, *tables: Table) -> None:
    """The same tables as a Markdown file; nothing where no file was asked for."""
    if path is None:
        return
    lines: list[str] = []
    for title, header, rows in tables:
        lines += ["", title + ":", "", "| " + " | ".join(header) + " |", "|---" * len(header) + "|"]
        lines += ["| " + " | ".join(map(_cell, row)) + " |" for row in rows]
    write_text(path, "\n".join(lines[1:]) + "\n")
    say(f"table: {path}")


def show(markdown: Path | None, *tables: Table, notes: Sequence[str] = ()) -> None:
    """Prints tables and the lines that stand under them, and writes the tables to `markdown`."""
    for table in tables:
        print_table(*table)
    say(*notes)
    write_markdown(markdown, *tables)


def _cell(value: Any) -> str:
    if value is None:
        return "–"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def write_metrics(path: Path | None, verb: str, *, seed: int, config: dict, **content: Any) -> None:
    """Writes the file of `--json` (docs/reference/files.md: metrics); nothing where no file was asked for."""
    if path is None:
        return
    head = {"schema": f"np_drake.{verb}/1", "version": version("np_drake"), "seed": seed, "config": config}
    write_json(path, {**head, **content})
    say(f"metrics: {path}")


def require_files(*paths: Path | None) -> None:
    """Asks before long work whether the files that were asked for can be written. Raises OSError if not."""
    for path in paths:
        if path is not None:
            require_writable(path)


def require_folder(path: Path) -> None:
    """Asks before long work whether `make_folder` will succeed, and creates nothing. Raises OSError if not."""
    there = next(folder for folder in (path.absolute(), *path.absolute().parents) if folder.exists())
    if not there.is_dir():
        raise NotADirectoryError(f"{there}: must be a folder; it is a file.")
    require_writable(there / "any")


def make_folder(path: Path) -> Path:
    """The folder of `--out`, created where it is missing. Raises OSError where nothing can be written in it."""
    path.mkdir(parents=True, exist_ok=True)
    require_writable(path / "any")
    return path
