"""One runner for all verbs: checks files, runs the body, writes and prints its report.

    @reports("reproduce", seed=1000, out=options.Out)
    def verb(run: Run, spacing: ... = 1) -> Report: ...

adds `--seed`, `--out`, `--json` and `--markdown` behind the verb's own options. `many=True` adds
`--jobs` and `--scheduler`, by which the cases of `run.cases(…)` are worked on, and prints their
processor time at the end.
"""

import dataclasses as dc
import functools
import inspect
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import typer

from diagrams.batch.run import Report as Report
from diagrams.batch.run import Run as Run
from diagrams.batch.run import Workers, make_folder
from diagrams.cli import options, output
from np_drake.files.atomic_file import is_regular, lock_outputs
from np_drake.files.input_file import is_own

HELP = {"help_option_names": ["-h", "--help"]}


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


def reports(
    schema: str,
    *,
    seed: int | None,
    out: Any = None,
    folder: Path | None = None,
    markdown: bool = True,
    many: bool = False,
    files: Sequence[str] = (),
    folders: Sequence[str] = (),
) -> Callable[[Callable[..., Report]], Callable[..., None]]:
    """Return a decorator that makes a verb of a body `(run, own options) -> Report`.

    Args:
        schema: name in the head of the `--json` file.
        seed: default of `--seed`; None: nothing is drawn, and the option is accepted but hidden.
        out: annotated type of `--out`, a folder; None: the runner adds no such option.
        folder: default of `--out`.
        many: whether the verb works on many cases: adds the options of its workers.
        files: options of the body whose file it writes.
        folders: options of the body whose folder it writes.
    """
    shared: dict[str, tuple[Any, Any]] = {}
    shared["seed"] = (options.Undrawn if seed is None else options.Seed, seed or 0)
    if many:
        shared["jobs"] = (options.Jobs, options.DEFAULT_JOBS)
        shared["scheduler"] = (options.Scheduler, "")
    if out is not None:
        shared["out"] = (out, folder)
    shared["json"] = (options.Json, None)
    if markdown:
        shared["markdown"] = (options.Markdown, None)

    def decorate(body: Callable[..., Report]) -> Callable[..., None]:
        @functools.wraps(body)
        def verb(**given: Any) -> None:
            asked = {name: given.pop(name) for name in shared}
            out_folder, drawn = asked.get("out"), asked["seed"]
            pages = {n: asked[n] for n in ("json", "markdown") if asked.get(n) is not None}
            written = [given[name] for name in files if given.get(name) is not None]
            kept = [given[name] for name in folders if given.get(name) is not None]
            kept += [out_folder] if out_folder else []
            output.require_outputs(*pages.values(), *written, folders=kept)
            cases = None if out_folder is None else out_folder / options.CASES
            workers = Workers(asked.get("jobs", 1), asked.get("scheduler", ""), cases).check()
            before = {path: _version(path) for path in pages.values()}
            held = lock_outputs(kept, [path for path in written if is_regular(path)])
            with tempfile.TemporaryDirectory() as scratch, held:
                paths = (out_folder, asked["json"], Path(scratch))
                with _removed_at_failure(None if many else out_folder):
                    report = body(Run(drawn, *paths, workers, output.progress), **given)
                    _show(dc.replace(report, notes=[*report.notes, *workers.cost()]), out_folder)
                for name, path in pages.items():
                    if _version(path) != before[path]:
                        raise ValueError(
                            f"--{name}: {path} is a file that this verb writes itself, and is "
                            f"kept as such; name another."
                        )
                values = {"seed": drawn, "config": report.config, **report.metrics}
                output.write_metrics(pages.get("json"), schema, **values)
                output.write_markdown(pages.get("markdown"), *report.tables, lines=report.summary)
                if report.failure is not None:
                    raise report.failure

        _, *own = inspect.signature(body, eval_str=True).parameters.values()
        keyword = inspect.Parameter.KEYWORD_ONLY
        parameters = [parameter.replace(kind=keyword) for parameter in own]
        for name, (kind, default) in shared.items():
            parameters.append(inspect.Parameter(name, keyword, default=default, annotation=kind))
        verb.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        verb.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return verb

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
    output.tell(*report.lines)
    for table in report.tables:
        output.print_table(*table)
    output.tell(*report.summary)
    output.tell(*report.notes)
    if out is None:
        return
    for name, draw in report.figures.items():
        output.save_figure(draw(), make_folder(out) / name)
    if report.write is not None:
        report.write(make_folder(out))


def _version(path: Path) -> tuple[int, int] | None:
    """Return what tells a version of a file from the next; None where there is none."""
    if not path.is_file():
        return None
    stat = path.stat()
    return stat.st_ino, stat.st_mtime_ns
