"""Console, progress bars, tables, `--json` files, figures and folders of every verb.

Only the command line prints. Files appear whole or not at all (`np_drake.files.atomic_file`).
"""

import os
import sys
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from os.path import lexists
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.progress import Progress, TextColumn
from rich.table import Table as RichTable

from diagrams.batch.run import Advance, Table
from np_drake.files.atomic_file import is_regular, require_writable, write_json, write_text
from np_drake.files.number_text import NBSP, NOTHING, number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 100  # columns of a line: at most, and where no terminal tells


def console(*, stderr: bool = False) -> Console:
    """Return a console at most `WIDTH` columns wide, and that wide where the output is no
    terminal.
    """
    stream = sys.stderr if stderr else sys.stdout
    width = min(WIDTH, Console(file=stream).width) if stream.isatty() else WIDTH
    return Console(file=stream, width=width, highlight=False, markup=False, emoji=False)


def say(*lines: str) -> None:
    """Print plain lines on stdout; a reader that goes away, as `head` does, ends no run."""
    try:
        for line in lines:
            print(line, flush=True)
    except BrokenPipeError:
        discard_output()


def discard_output() -> None:
    """Print into nothing from now on; the files of the run are still wanted."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def progress(description: str, total: float) -> Iterator[Advance]:
    """Show a progress bar on stderr and yield `advance(done, text)`.

    Where stderr is no terminal nothing is shown: the one line of an error stands alone.
    """
    err = console(stderr=True)
    columns = (*Progress.get_default_columns(), TextColumn("{task.fields[text]}", markup=False))
    with Progress(*columns, console=err, disable=not err.is_interactive) as bar:
        task = bar.add_task(description, total=total, text="")

        def advance(done: float, text: str = "") -> None:
            bar.update(task, completed=done, text=text)

        yield advance


def tell(*lines: str) -> None:
    """Print sentences on stdout, broken between words."""
    for line in lines:
        width = console().width
        broken = textwrap.wrap(line, width, break_long_words=False, break_on_hyphens=False)
        say(*(broken or [""]))


def print_table(title: str, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Print a table: text to the left, numbers to the right; one column of text is a list."""
    tell(title)
    if len(header) == 1:
        tell(*(f"- {cell_text(text)}" for (text,) in rows))
    else:
        table = RichTable(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
        for k, name in enumerate(header):
            right = all(isinstance(row[k], float | int | None) for row in rows)
            table.add_column(name, justify="right" if right else "left", overflow="fold")
        for row in rows:
            table.add_row(*map(cell_text, row))
        screen = console()
        with screen.capture() as drawn:
            screen.print(table)
        say(*(line.rstrip() for line in drawn.get().splitlines()))
    say("")


def cell_text(value: object) -> str:
    """Return a value as text: numbers with three digits, a dash for none."""
    if value is None:
        return NOTHING
    return (number(value) if isinstance(value, float) else str(value)).replace(NBSP, " ")


def write_markdown(path: Path | None, *tables: Table, lines: Sequence[str] = ()) -> None:
    """Write tables, and lines as a list below them, as a Markdown file; no path, no file."""
    if path is None:
        return
    blocks = []
    for title, header, rows in tables:
        body = ["| " + " | ".join(header) + " |", "|---" * len(header) + "|"]
        for row in rows:
            cells = [cell_text(value).strip().replace("|", "\\|") for value in row]
            body.append("| " + " | ".join(cells) + " |")
        blocks.append("\n".join([f"{title}:", "", *body]))
    blocks += ["\n".join(f"- {line}" for line in lines)] if lines else []
    write_text(path, "\n\n".join(blocks) + "\n")
    say(f"table: {path}")


def write_metrics(path: Path | None, verb: str, *, seed: int, config: dict, **content: Any) -> None:
    """Write the file of `--json` (docs/reference/files.md: metrics); no path, no file."""
    if path is None:
        return
    head = {"schema": f"np_drake.{verb}/1", "version": version("np_drake")}
    write_json(path, {**head, "seed": seed, "config": config, **content})
    say(f"metrics: {path}")


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure and print where it is."""
    from np_drake.files.figure_file import save

    save(figure, path)
    say(f"figure: {path}")


def require_outputs(*files: Path | None, folders: Sequence[Path] = ()) -> None:
    """Check before long work that files and folders can be written, and create nothing.

    Raises: OSError: if one cannot be written; ValueError: if two files are one.
    """
    named = [path for path in files if path is not None]
    for path in named:
        require_writable(path)
    ordinary = [path.resolve() for path in named if is_regular(path)]
    if twice := [path for path in ordinary if ordinary.count(path) > 1]:
        raise ValueError(
            f"{twice[0]}: must be named by one option alone; two files are to be written there."
        )
    for folder in folders:
        above = (folder.absolute(), *folder.absolute().parents)
        there = next(path for path in above if lexists(path))
        if not there.is_dir():
            raise NotADirectoryError(
                f"{there}: must be a folder; it is a file, or a link to nothing."
            )
        require_writable(there / "any")
