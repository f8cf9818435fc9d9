"""One runner for all verbs: checks files, runs the body, writes and prints its report.

    @reports("reproduce", seed=1000, out=options.Out)
    def verb(run: Run, spacing: ... = 1) -> Report: ...

adds `--seed`, `--out`, `--json` and `--markdown` behind the verb's own options.
"""

import dataclasses as dc
import functools
import inspect
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diagrams.cli import options
from diagrams.cli.output import (
    Table,
    counted,
    make_folder,
    print_table,
    progress,
    require_outputs,
    save_figure,
    say,
    write_markdown,
    write_metrics,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KEYWORD = inspect.Parameter.KEYWORD_ONLY


@dc.dataclass(frozen=True)
class Run:
    """Seed, files and folders of one run of a verb."""

    seed: int
    out: Path | None
    json: Path | None
    scratch: Path

    @property
    def folder(self) -> Path:
        """Folder of `--out`, created on first use; without it a scratch folder that ends with the run."""
        return make_folder(self.out) if self.out else self.scratch


@dc.dataclass(frozen=True)
class Report:
    """Tables of a verb, and what its files hold."""

    tables: Sequence[Table]
    config: dict[str, Any]
    metrics: dict[str, Any]  # of --json, behind its head
    lines: Sequence[str] = ()  # printed above the tables
    summary: Sequence[str] = ()  # printed below the tables, and in the Markdown file
    notes: Sequence[str] = ()  # printed below the tables only
    figures: Mapping[str, Callable[[], "Figure"]] = dc.field(
        default_factory=dict
    )  # drawn where --out is given
    write: Callable[[Path], None] | None = None  # writes further files into the folder of --out
    failure: Exception | None = None  # raised when all is written and printed


def reports(
    schema: str, *, seed: int | None, out: Any = None, folder: Path | None = None, markdown: bool = True
) -> Callable[[Callable[..., Report]], Callable[..., None]]:
    """Return a decorator that makes a verb of a body `(run, own options) -> Report`.

    Args:
        schema: Name in the head of the `--json` file.
        seed: Default of `--seed`; None: nothing is drawn, and the option is accepted but hidden.
        out: Annotated type of `--out`; None: the runner adds no such option.
        folder: Default of `--out`.
        markdown: Whether there is a `--markdown`.
    """
    shared = [("seed", options.Undrawn if seed is None else options.Seed, seed or 0)]
    shared += [("out", out, folder)] if out is not None else []
    shared += [("json", options.Json, None)] + [("markdown", options.Markdown, None)] * markdown

    def decorate(body: Callable[..., Report]) -> Callable[..., None]:
        @functools.wraps(body)
        def verb(**given: Any) -> None:
            files = {name: given.pop(name) for name, *_ in shared}
            require_outputs(files["json"], files.get("markdown"), folder=files.get("out"))
            with tempfile.TemporaryDirectory() as scratch:
                report = body(Run(files["seed"], files.get("out"), files["json"], Path(scratch)), **given)
                publish(report, schema, **files)

        _, *own = inspect.signature(body, eval_str=True).parameters.values()
        added = [inspect.Parameter(n, KEYWORD, default=value, annotation=kind) for n, kind, value in shared]
        parameters = [*(parameter.replace(kind=KEYWORD) for parameter in own), *added]
        verb.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        verb.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return verb

    return decorate


def publish(
    report: Report,
    schema: str,
    *,
    seed: int,
    out: Path | None = None,
    json: Path | None = None,
    markdown: Path | None = None,
) -> None:
    """Write the metrics of a report, print it, and write its tables as Markdown and its figures.

    Raises: Exception: the failure that the report holds, last.
    """
    write_metrics(json, schema, **{"seed": seed, "config": report.config, **report.metrics})
    say(*report.lines)
    for table in report.tables:
        print_table(*table)
    say(*report.summary, *report.notes)
    write_markdown(markdown, *report.tables, lines=report.summary)
    if out is not None:
        for name, draw in report.figures.items():
            save_figure(draw(), make_folder(out) / name)
        if report.write is not None:
            report.write(make_folder(out))
    if report.failure is not None:
        raise report.failure


@contextmanager
def counting(description: str, what: str = "") -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar and yield `on_progress(done, total)`, which counts `what` behind it."""
    with progress(description, 1.0) as advance:
        yield counted(advance, what)
