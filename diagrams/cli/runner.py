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
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from diagrams.batch.run import Report, Run, Workers, counted, make_folder
from diagrams.cli import options, output
from np_drake.files.atomic_file import is_regular, lock_outputs
from np_drake.files.input_file import is_own

WRITTEN = ("out",)  # options of a body whose file or folder a run holds for itself
KEYWORD = inspect.Parameter.KEYWORD_ONLY
Shared = tuple[str, Any, Any]  # an option: name, annotated type, default


def reports(
    schema: str,
    *,
    seed: int | None,
    out: Any = None,
    folder: Path | None = None,
    markdown: bool = True,
    many: bool = False,
    holds: Sequence[str] = (),
) -> Callable[[Callable[..., Report]], Callable[..., None]]:
    """Return a decorator that makes a verb of a body `(run, own options) -> Report`.

    Args:
        schema: name in the head of the `--json` file.
        seed: default of `--seed`; None: nothing is drawn, and the option is accepted but hidden.
        out: annotated type of `--out`; None: the runner adds no such option.
        folder: default of `--out`.
        markdown: whether there is a `--markdown`.
        many: whether the verb works on many cases: adds the options of its workers.
        holds: further options of the body, besides `WRITTEN`, whose file or folder it writes.
    """
    last: list[Shared] = [
        ("seed", options.Undrawn if seed is None else options.Seed, seed or 0),
        *(
            [("jobs", options.Jobs, options.DEFAULT_JOBS), ("scheduler", options.Scheduler, "")]
            if many
            else []
        ),
        *([("out", out, folder)] if out is not None else []),
        ("json", options.Json, None),
        *([("markdown", options.Markdown, None)] if markdown else []),
    ]

    def decorate(body: Callable[..., Report]) -> Callable[..., None]:
        @functools.wraps(body)
        def verb(**given: Any) -> None:
            files = {name: given.pop(name) for name, *_ in last}
            written = {
                name: given[name] for name in (*WRITTEN, *holds) if given.get(name) is not None
            }
            paths = [path for name, path in written.items() if name in own_files]
            folders = [path for name, path in written.items() if name not in own_files]
            folders += [files["out"]] if files.get("out") else []
            output.require_outputs(files["json"], files.get("markdown"), *paths)
            for folder in folders:
                output.require_outputs(folder=folder)
            workers = _workers(files.pop("jobs", 1), files.pop("scheduler", ""), files.get("out"))
            asked = {
                name: files[name] for name in ("json", "markdown") if files.get(name) is not None
            }
            before = _versions(asked)
            held = lock_outputs(folders, [path for path in paths if is_regular(path)])
            with tempfile.TemporaryDirectory() as scratch, held:
                paths_of_run = (files.get("out"), files["json"], Path(scratch))
                with _removed_at_failure(None if many else files.get("out")):
                    report = body(
                        Run(files["seed"], *paths_of_run, workers, output.progress), **given
                    )
                    _show(dc.replace(report, notes=[*report.notes, *workers.cost()]))
                    _write_folder(report, files.get("out"))
                _require_unchanged(asked, before)
                values = {"seed": files["seed"], "config": report.config, **report.metrics}
                output.write_metrics(asked.get("json"), schema, **values)
                output.write_markdown(asked.get("markdown"), *report.tables, lines=report.summary)
                if report.failure is not None:
                    raise report.failure

        _, *own = inspect.signature(body, eval_str=True).parameters.values()
        own_files = {parameter.name for parameter in own if _metavar(parameter) == "FILE"}
        parameters = [*(p.replace(kind=KEYWORD) for p in own), *_parameters(last)]
        verb.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        verb.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return verb

    return decorate


@contextmanager
def held_output(file: Path) -> Iterator[None]:
    """Check the file that a verb without a report writes, and hold it for itself until the end of
    the block.

    Raises: as `output.require_outputs` and `lock_outputs`.
    """
    output.require_outputs(file)
    with lock_outputs([], [file] if is_regular(file) else []):
        yield


def _workers(jobs: int, scheduler: str, out: Path | None) -> Workers:
    """Return the workers of a run.

    Raises: ValueError: where no scheduler answers; before any work.
    """
    return Workers(jobs, scheduler, None if out is None else out / options.CASES).check()


def _metavar(parameter: inspect.Parameter) -> str | None:
    return next(
        (option.metavar for option in getattr(parameter.annotation, "__metadata__", ())), None
    )


def _parameters(shared: Sequence[Shared]) -> list[inspect.Parameter]:
    return [
        inspect.Parameter(name, KEYWORD, default=value, annotation=kind)
        for name, kind, value in shared
    ]


@contextmanager
def _removed_at_failure(folder: Path | None) -> Iterator[None]:
    """Remove what a run that fails has itself added to its folder; finished cases stay, for the
    next run to go on from.

    What others put there meanwhile stays as well.
    """

    def content() -> set[Path]:
        return set() if folder is None else set(folder.rglob("*"))

    before = content()
    try:
        yield
    except BaseException:
        for path in sorted(content() - before, reverse=True):  # what a folder holds comes before it
            with suppress(OSError):  # a folder that holds more
                if path.is_dir() and not path.is_symlink():
                    path.rmdir()
                elif is_own(path):
                    path.unlink()
        raise


def _show(report: Report) -> None:
    """Print a report."""
    output.tell(*report.lines)
    for table in report.tables:
        output.print_table(*table)
    output.tell(*report.summary)
    output.tell(*report.notes, indent="  ")


def _write_folder(report: Report, out: Path | None) -> None:
    """Write the figures of a report, and what it writes itself, to the folder of `--out`."""
    if out is None:
        return
    for name, draw in report.figures.items():
        output.save_figure(draw(), make_folder(out) / name)
    if report.write is not None:
        report.write(make_folder(out))


def _versions(files: Mapping[str, Path]) -> dict[str, tuple[int, int] | None]:
    """Return what tells a version of each file from the next; None where there is none, and for a
    device.
    """
    found = {name: path.stat() if path.is_file() else None for name, path in files.items()}
    return {
        name: None if stat is None else (stat.st_ino, stat.st_mtime_ns)
        for name, stat in found.items()
    }


def _require_unchanged(
    files: Mapping[str, Path], before: Mapping[str, tuple[int, int] | None]
) -> None:
    """Check that a run has not written to a file that an option asks for.

    Raises: ValueError: where it has; its own file stays.
    """
    for name, now in _versions(files).items():
        if now != before[name]:
            raise ValueError(
                f"--{name}: {files[name]} is a file that this verb writes itself, and is "
                f"kept as such; name another."
            )


@contextmanager
def counting(description: str, what: str = "") -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar and yield `on_progress(done, total)`."""
    with output.progress(description, 1.0) as advance:
        yield counted(advance, what)
