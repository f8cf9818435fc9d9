"""Console, progress bars, tables, `--json` files, figures and folders of every verb.

Only the command line prints. Files appear whole or not at all (`np_drake.files.atomic_file`).
"""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from os.path import lexists
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console, RenderableType
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.text import Text

from diagrams.batch.run import Advance, Table
from diagrams.cli.table_text import cell_text, table_lines, wrapped
from np_drake.files.atomic_file import is_regular, require_writable, write_json, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, NARROW, LEAST = (
    100,
    80,
    40,
)  # columns that a table may take: at most, where no terminal tells, at least


def console(*, stderr: bool = False) -> Console:
    """Return a console at most `WIDTH` columns wide, and that wide where the output is no
    terminal.
    """
    stream = sys.stderr if stderr else sys.stdout
    width = min(WIDTH, Console(file=stream).width) if stream.isatty() else WIDTH
    return Console(file=stream, width=width, highlight=False)


def say(*lines: str) -> None:
    """Print plain lines on stdout."""
    for line in lines:
        if sys.stdout.isatty():
            sys.stdout.write(
                f"{line}\n"
            )  # above a progress bar: a console of its own would write into it
        else:
            console().print(line, markup=False, soft_wrap=True)


class _Bar(Progress):
    """Progress bars with their texts below, which break where a line ends."""

    def get_renderables(self) -> list[RenderableType]:
        return [
            self.make_tasks_table(self.tasks),
            *(Text(t.fields["text"]) for t in self.tasks if t.fields["text"]),
        ]


@contextmanager
def progress(description: str, total: float) -> Iterator[Advance]:
    """Show a progress bar on stderr and yield `advance(done, text)`.

    `text` stands below the bar. Where stderr is no terminal nothing is shown: the one line of an
    error stands alone.

    Args:
        total: value of `done` at the end.
    """
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    err = console(stderr=True)
    with _Bar(*columns, console=err, disable=not err.is_interactive) as bar:
        task = bar.add_task(description, total=total, text="")

        def advance(done: float, text: str = "") -> None:
            bar.update(task, completed=done, text=text)

        yield advance


def screen_width() -> int:
    """Return the columns that tables and sentences may take: those of the terminal, `WIDTH` at
    most; else `NARROW`.
    """
    if not sys.stdout.isatty():
        return NARROW
    return max(min(WIDTH, Console(file=sys.stdout).width), LEAST)


def tell(*lines: str, indent: str = "") -> None:
    """Print sentences on stdout in the columns of tables, broken between words."""
    for line in lines:
        say(*wrapped(line, screen_width(), indent=indent))


def print_table(title: str, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Print a table in the columns of the terminal: text to the left, numbers to the right with
    three digits.
    """
    say(*table_lines(title, header, rows, screen_width()), "")


def write_markdown(path: Path | None, *tables: Table, lines: Sequence[str] = ()) -> None:
    """Write tables, and lines as a list below them, as a Markdown file.

    Args:
        path: of the file; None where none was asked for: nothing is written.
    """
    if path is None:
        return
    blocks = []
    for title, header, rows in tables:
        body = ["| " + " | ".join(header) + " |", "|---" * len(header) + "|"]
        body += [
            "| " + " | ".join(cell_text(v).strip().replace("|", "\\|") for v in row) + " |"
            for row in rows
        ]
        blocks.append("\n".join([f"{title}:", "", *body]))
    blocks += ["\n".join(f"- {line}" for line in lines)] if lines else []
    write_text(path, "\n\n".join(blocks) + "\n")
    say(f"table: {path}")


def write_metrics(path: Path | None, verb: str, *, seed: int, config: dict, **content: Any) -> None:
    """Write the file of `--json` (docs/reference/files.md: metrics).

    Args:
        path: of the file; None where none was asked for: nothing is written.
    """
    if path is None:
        return
    head = {
        "schema": f"np_drake.{verb}/1",
        "version": version("np_drake"),
        "seed": seed,
        "config": config,
    }
    write_json(path, {**head, **content})
    say(f"metrics: {path}")


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure and print where it is."""
    from np_drake.files.figure_file import save

    save(figure, path)
    say(f"figure: {path}")


def require_outputs(*files: Path | None, folder: Path | None = None) -> None:
    """Check before long work that files and folder can be written, and create nothing.

    Args:
        files: that are written; None for one that is not asked for.
    Raises: OSError: if one cannot be written; ValueError: if two are one.
    """
    named = [path for path in files if path is not None]
    for path in named:
        require_writable(path)
    ordinary = [path.resolve() for path in named if is_regular(path)]
    if twice := [path for path in ordinary if ordinary.count(path) > 1]:
        raise ValueError(
            f"{twice[0]}: must be named by one option alone; two files are to be written there."
        )
    if folder is not None:
        require_folder(folder)


def require_folder(path: Path) -> None:
    """Check before long work that `make_folder` will succeed, and create nothing.

    Raises: OSError: if it will not.
    """
    there = next(
        folder for folder in (path.absolute(), *path.absolute().parents) if lexists(folder)
    )
    if not there.is_dir():
        raise NotADirectoryError(f"{there}: must be a folder; it is a file, or a link to nothing.")
    require_writable(there / "any")
