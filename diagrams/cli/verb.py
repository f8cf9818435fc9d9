"""What every verb is made of: shared options, console, tables and files, and one runner that checks
files, runs the body, writes and prints its report.

    @reports("reproduce", seed=1000, out=OUT)
    def verb(run: Run, spacing: ... = 1) -> Report: ...

adds `--seed`, `--out`, `--json` and `--markdown` behind the options of the verb. `many=True` adds
`--jobs` and `--scheduler`, by which the cases of `run.cases(…)` are worked on, and prints their
processor time at the end. A last parameter `asked`, a dataclass, stands for an option a field
(`option`).

Only the command line prints. Files appear whole or not at all (`np_drake.files.file_access`).
"""

import dataclasses as dc
import functools
import inspect
import os
import sys
import tempfile
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import version
from os.path import lexists
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.progress import Progress, TextColumn
from rich.table import Table as RichTable
from typer import Option

from diagrams.batch.run import Advance, Report, Run, Table, Workers, make_folder, require
from np_drake.files.file_access import (
    is_own,
    is_regular,
    lock_outputs,
    require_writable,
    write_json,
    write_text,
)
from np_drake.files.interruption import end_in_order
from np_drake.files.number_text import NBSP, NOTHING, grouped, number

HELP = {"help_option_names": ["-h", "--help"]}
WIDTH = 100  # columns of a line: at most, and where no terminal tells
EPILOG = (
    "Shared options: --seed fixes every random draw. --out DIR is created where it is missing and "
    "holds figures, logs and models. --json FILE, of every verb but vehicle, holds schema, "
    "version, seed, configuration and every value. --markdown FILE holds the printed tables. Files "
    "and folders are checked before long work; a file appears whole or not at all. --solver: sqp "
    "unless a scenario file names another; ipopt (MathematicalProgram) is the reference. Verbs of "
    "many cases: --jobs N local processes, or --scheduler ADDRESS of a Dask cluster; with --out "
    "DIR a case is a file in DIR/cases, and the same command goes on where it was interrupted."
)
CASES = "cases"  # folder in --out with a file for every case
OptionalPath = Path | None
Json = Annotated[OptionalPath, Option("--json", metavar="FILE", help="Write the values as JSON.")]
OUT = "Folder for logs and figures."
OUT_OF_CASES = "Folder for figures, models and a file for every case, to resume from."
Markdown = Annotated[
    OptionalPath, Option("--markdown", metavar="FILE", help="Write the table as Markdown.")
]
Jobs = Annotated[int, Option("--jobs", min=1, max=1024, help="Processes on this machine.")]
Scheduler = Annotated[
    str,
    Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Work on the Dask cluster of this scheduler: tcp://HOST:PORT.",
    ),
]
VehicleFile = Annotated[
    OptionalPath,
    Option(
        "--vehicle",
        metavar="VEHICLE",
        help="Vehicle file (YAML) or a name of `np-drake vehicle list`; default: the paper's.",
    ),
]
Wheelbase = Annotated[
    float | None, Option(help="Distance from motor to motor, across the centre [m].")
]
Propeller = Annotated[float | None, Option(help="Propeller diameter [m].")]
Order = Annotated[
    str | None,
    Option(
        metavar="AUTOPILOT",
        help="Order of the rotors in logs: px4 | ardupilot | betaflight | crazyflie.",
    ),
]
Props = Annotated[
    str | None,
    Option(
        metavar="WAY", help="Propellers turn in | out at the front; default: in, or the file's."
    ),
]
LogMap = Annotated[
    OptionalPath,
    Option(
        "--map",
        metavar="FILE",
        help="Map of columns and conventions (YAML), or a public data set: idsia, nanobench; "
        "default: by the log's own names.",
    ),
]


class Verbs(typer.Typer):
    """Application, or a group of one: `-h` prints its help, in which no unit is taken for
    markup.
    """

    def __init__(self, **settings: Any):
        plain = {"rich_markup_mode": None, "pretty_exceptions_enable": False}
        super().__init__(**(plain | {"context_settings": HELP} | settings))

    def command(self, name: str | None = None, **settings: Any) -> Callable:  # type: ignore[override]
        """Return a decorator that registers a verb, with settings of `Typer.command`."""
        return super().command(name, **({"context_settings": HELP} | settings))


def option(help: str, *names: str, default: Any = None, kind: Any = Option, **settings: Any) -> Any:
    """Return a field of a dataclass that is an option of a verb.

    Args:
        names: as `--log`; none: the field's.
        default: `dataclasses.MISSING` for an option that must be given.
        kind: `Argument` for a word without a name.
        settings: of `typer.Option`.
    """
    return dc.field(default=default, metadata={"option": kind(*names, help=help, **settings)})


def with_options(body: Callable[..., Any]) -> Callable[..., Any]:
    """Return the body with the fields of its last parameter as keyword arguments, where that is
    called `asked`, a dataclass of options.
    """
    *first, last = inspect.signature(body, eval_str=True).parameters.values()
    record: Any = last.annotation
    if last.name != "asked":
        return body

    @functools.wraps(body)
    def filled(*run: Run, **given: Any) -> Any:
        return body(*run, record(**given))

    options = [*first]
    parameters = inspect.signature(record, eval_str=True).parameters
    for field in dc.fields(record):
        parameter = parameters[field.name]
        kind = field.metadata.get("option")  # None: the annotation holds it
        what = Annotated[parameter.annotation, kind] if kind else parameter.annotation
        options.append(parameter.replace(annotation=what))
    return signed(filled, options)


def signed(verb: Callable[..., Any], parameters: Sequence[inspect.Parameter]) -> Any:
    """Return the function with these parameters, from which typer reads its options."""
    keywords = [p if p.name == "run" else p.replace(kind=p.KEYWORD_ONLY) for p in parameters]
    verb.__signature__ = inspect.Signature(keywords)  # type: ignore[attr-defined]
    verb.__annotations__ = {parameter.name: parameter.annotation for parameter in keywords}
    return verb


def reports(
    schema: str,
    *,
    seed: int | None,
    out: str = "",
    folder: Path | None = None,
    markdown: bool = True,
    many: bool = False,
    files: Sequence[str] = (),
    folders: Sequence[str] = (),
) -> Callable[[Callable[..., Report]], Callable[..., None]]:
    """Return a decorator that makes a verb of a body `(run, options) -> Report`.

    Args:
        schema: name in the head of the `--json` file.
        seed: default of `--seed`; None: nothing is drawn, and the option is accepted but hidden.
        out: help of `--out`, a folder; empty: the runner adds no such option.
        folder: default of `--out`.
        many: whether the verb works on many cases: adds the options of its workers.
        files: options of the body whose file it writes.
        folders: options of the body whose folder it writes.
    """
    seeds = Option(
        "--seed", hidden=seed is None, min=0, max=2**31 - 1, help="Seed of every random draw."
    )
    kinds: dict[str, tuple[Any, Any]] = {
        "seed": (Annotated[int, seeds], seed or 0),
        "jobs": (Jobs, 2),
        "scheduler": (Scheduler, ""),
        "out": (Annotated[OptionalPath, Option("--out", metavar="DIR", help=out)], folder),
        "json": (Json, None),
        "markdown": (Markdown, None),
    }
    wanted = {"jobs": many, "scheduler": many, "out": bool(out), "markdown": markdown}
    shared = {name: kind for name, kind in kinds.items() if wanted.get(name, True)}

    def decorate(function: Callable[..., Report]) -> Callable[..., None]:
        body = with_options(function)

        @functools.wraps(body)
        def verb(**given: Any) -> None:
            end_in_order()  # what is loaded from here on is given up like any work
            asked = {name: given.pop(name) for name in shared}
            out_folder = asked.get("out")
            pages = {n: asked[n] for n in ("json", "markdown") if asked.get(n) is not None}
            written = [path for path in map(given.get, files) if path is not None]
            kept = [path for path in (*map(given.get, folders), out_folder) if path is not None]
            require_outputs(*pages.values(), *written, folders=kept)
            cases = None if out_folder is None else out_folder / CASES
            workers = Workers(asked.get("jobs", 1), asked.get("scheduler", ""), cases).check()
            locks = lock_outputs(kept, [path for path in written if is_regular(path)])
            with tempfile.TemporaryDirectory() as scratch, locks:
                paths = (out_folder, asked["json"], Path(scratch))
                with _removed_at_failure(None if many else out_folder):
                    report = body(Run(asked["seed"], *paths, workers, progress), **given)
                    _show(dc.replace(report, notes=[*report.notes, *workers.cost()]), out_folder)
                for name, path in pages.items():
                    require(
                        not is_own(path),
                        f"--{name}: {path} is a file that this verb writes itself, and is kept as "
                        f"such; name another.",
                    )
                values = {"seed": asked["seed"], "config": report.config, **report.metrics}
                write_metrics(pages.get("json"), schema, **values)
                write_markdown(pages.get("markdown"), *report.tables, lines=report.summary)
                if report.failure is not None:
                    raise report.failure

        _, *options = inspect.signature(body, eval_str=True).parameters.values()
        added = [
            inspect.Parameter(
                name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind
            )
            for name, (kind, default) in shared.items()
        ]
        return signed(verb, [*options, *added])

    return decorate


@contextmanager
def _removed_at_failure(folder: Path | None) -> Iterator[None]:
    """Remove what a run that fails has itself added to its folder; finished cases stay, for the
    next run to go on from.

    What others put there meanwhile stays as well.
    """
    before = set() if folder is None else set(folder.rglob("*"))
    try:
        yield
    except BaseException:
        added = set() if folder is None else set(folder.rglob("*")) - before
        for path in sorted(added, reverse=True):  # what a folder holds comes before it
            with suppress(OSError):  # a folder that holds more
                if path.is_dir() and not path.is_symlink():
                    path.rmdir()
                elif is_own(path):
                    path.unlink()
        raise


def _show(report: Report, out: Path | None) -> None:
    """Print a report, and write its figures and files to the folder of `--out`."""
    from np_drake.files.figure_file import save

    tell(*report.lines)
    for table in report.tables:
        print_table(*table)
    tell(*report.summary)
    tell(*report.notes)
    if report.warnings:
        print_table("warnings", ["warning"], [(text,) for text in report.warnings])
    if out is None:
        return
    for name, draw in report.figures.items():
        save(draw(), make_folder(out) / name)
        say(f"figure: {out / name}")
    if report.write is not None:
        report.write(make_folder(out))


def noted(logs: Sequence[Any], also: Sequence[str] = ()) -> list[str]:
    """Return what readers derived or repaired in logs, and further lines, each once."""
    lines = [f"{log.name}: {note}" for log in logs for note in log.notes]
    return grouped([*lines, *also], [log.name for log in logs])


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
def progress(description: str, total: float = 1.0) -> Iterator[Advance]:
    """Show a progress bar on stderr and yield `advance(done, text)`; the work done, it is full.

    Where stderr is no terminal nothing is shown: the one line of an error stands alone.
    """
    err = console(stderr=True)
    columns = (*Progress.get_default_columns(), TextColumn("{task.fields[text]}", markup=False))
    with Progress(*columns, console=err, disable=not err.is_interactive) as bar:
        task = bar.add_task(description, total=total, text="")
        yield lambda done, text="": bar.update(task, completed=done, text=text)
        bar.update(task, completed=total, text="")


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
        cells = [[cell_text(value).strip().replace("|", "\\|") for value in row] for row in rows]
        body = [f"| {' | '.join(row)} |" for row in (header, *cells)]
        blocks.append("\n".join([f"{title}:", "", body[0], "|---" * len(header) + "|", *body[1:]]))
    blocks += ["\n".join(f"- {line}" for line in lines)] if lines else []
    write_text(path, "\n\n".join(blocks) + "\n")
    say(f"table: {path}")


def write_metrics(path: Path | None, verb: str, *, seed: int, config: dict, **content: Any) -> None:
    """Write the file of `--json` (docs/reference/files.md: metrics); no path, no file."""
    if path is not None:
        head = {"schema": f"np_drake.{verb}/1", "version": version("np_drake")}
        write_json(path, {**head, "seed": seed, "config": config, **content})
        say(f"metrics: {path}")


def require_once(logs: Sequence[Path]) -> None:
    """Check that no log is given twice.

    Raises: ValueError: where one is.
    """
    resolved = [path.resolve() for path in logs]
    if twice := [path for path in logs if resolved.count(path.resolve()) > 1]:
        raise ValueError(f"{twice[0]}: must be given once; got it twice.")


def require_outputs(*files: Path, folders: Sequence[Path] = ()) -> None:
    """Check before long work that files and folders can be written, and create nothing.

    Raises: OSError: if one cannot be written; ValueError: if two files are one.
    """
    for path in files:
        require_writable(path)
    ordinary = [path.resolve() for path in files if is_regular(path)]
    if twice := [path for path in ordinary if ordinary.count(path) > 1]:
        raise ValueError(
            f"{twice[0]}: must be named by one option alone; two files are to be written there."
        )
    for folder in folders:
        above = (folder.absolute(), *folder.absolute().parents)
        there = next(path for path in above if lexists(path))
        require(
            there.is_dir(),
            f"{there}: must be a folder; it is a file, or a link to nothing.",
            NotADirectoryError,
        )
        require_writable(there / "any")
